// Sub-steps that keep an accuracy: Glocker's woodpecker, bouncing balls, stick-slip, tops.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <tether/contact/joints.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using tc::Vector6d;

using tether::linalg::at;

// Glocker's woodpecker (C. Glocker, Set-valued force laws, 2001; parameters as in Siconos'
// tutorials): linear in y, phi_M, phi_S. Each generalised coordinate, the bird's height and the two
// coordinates of each of three contact points are a body that moves along one axis only; rows of a
// joint hold everything else. Contact points have no mass to speak of.
namespace woodpecker {

constexpr double m_S = 4.5e-3, J_S = 7e-7, m_M = 3e-4, J_M = 5e-9, c = 5.6e-3, l_M = 0.01,
                 l_G = 0.015, l_S = 0.0201, h_S = 0.02, h_M = 0.0058, r_O = 2.5e-3, r_M = 3.1e-3;
constexpr double kPoint = 1e-10, kRadius = 0.01;  // kg, m
enum Index { y, phi_M, phi_S, bird, beak, top, bottom, pole, kBodies };

// Position of a moving body along x and z, each as a row times (y, phi_M, phi_S).
struct Line {
  int body;
  Vector3d x, z;
};
const std::array<Line, 7> kLines{{
    {y, {0, 0, 0}, {1, 0, 0}},
    {phi_M, {0, 1, 0}, {0, 0, 0}},
    {phi_S, {0, 0, 1}, {0, 0, 0}},
    {bird, {0, 0, 0}, {1, l_M, l_G}},
    {beak, {0, 0, -h_S}, {1, l_M, l_G - l_S}},
    {top, {0, h_M, 0}, {1, r_M, 0}},
    {bottom, {0, -h_M, 0}, {1, r_M, 0}},
}};

class Rows : public tc::JointEquations {
 public:
  explicit Rows(const tc::BodySet& bodies) : start_(bodies.position) {}
  int rows() const override { return 39; }
  void values(const tc::BodySet& b, double, double* g) override {
    const Vector3d q(moved(b, y).z(), moved(b, phi_M).x(), moved(b, phi_S).x());
    for (const Line& line : kLines) {
      const Vector3d d = moved(b, line.body);
      if (line.body != phi_M && line.body != phi_S) *g++ = d.x() - line.x.dot(q);
      *g++ = d.y();
      if (line.body != y) *g++ = d.z() - line.z.dot(q);
      const Eigen::Quaterniond t(b.orientation[at(line.body)].coeffs());
      for (int k = 0; k < 3; ++k) *g++ = 2 * t.vec()[k];
    }
  }
  void add_rows(const tc::BodySet&, double, tc::JointRows& rows) override {
    for (const Line& line : kLines) {
      if (line.body != phi_M && line.body != phi_S) along(rows, line.body, 0, line.x);
      along(rows, line.body, 1, Vector3d::Zero());
      if (line.body != y) along(rows, line.body, 2, line.z);
      for (int k = 3; k < 6; ++k) along(rows, line.body, k, Vector3d::Zero());
    }
  }

 private:
  Vector3d moved(const tc::BodySet& b, int i) const { return b.position[at(i)] - start_[at(i)]; }
  static void along(tc::JointRows& rows, int body, int axis, const Vector3d& of) {
    rows.add(body);
    rows.on(body, Vector6d::Unit(axis));
    if (of[0] != 0) rows.on(y, -of[0] * Vector6d::Unit(2));
    if (of[1] != 0) rows.on(phi_M, -of[1] * Vector6d::Unit(0));
    if (of[2] != 0) rows.on(phi_S, -of[2] * Vector6d::Unit(0));
  }
  std::vector<Vector3d> start_;
};

tc::Stepper make(double dt, double accuracy) {
  Scene scene(dt);
  scene.options.gravity.reset();
  scene.options.accuracy = accuracy;
  scene.options.tolerance = 1e-10;
  scene.options.impact_threshold = scene.options.restitution_threshold = 0;
  const auto add = [&](double mass, double size, const Vector3d& where) {
    // Far from each other: what touches are the points and their walls.
    return scene.bodies.add(mass, mass * size * size * Matrix3d::Identity() * 2 / 3, where);
  };
  add(m_M, 0.01, {0, 1, 0});
  add(J_M, 0.2, {0, 2, 0});
  add(J_S, 0.2, {0, 3, 0});
  add(m_S, 0.01, {0, 4, 0});
  for (int k = 0; k < 3; ++k) add(kPoint, 0.01, {0, 5.0 + k, 0});
  // Walls at x = 0 in the points' frame: the gaps at q = 0 are those of the mechanism.
  const std::array<double, 3> gap{l_M + l_G - l_S - r_O, r_M - r_O, r_M - r_O};
  const int wall = scene.bodies.add_fixed(Vector3d::Zero());
  const std::array<double, 3> e{0.5, 0, 0};
  scene.meetings.clear();
  for (int k = 0; k < 3; ++k) {
    scene.surfaces.push_back({beak + k, tc::Shape::sphere(kRadius), k});
    tc::Shape plane = tc::Shape::plane(Vector3d::UnitX());
    plane.position = Vector3d(-kRadius - gap[at(k)], 0, 0);
    scene.surfaces.push_back({wall, plane, 3 + k});
    scene.meetings.push_back({k, 3 + k, 0.3, e[at(k)]});
  }
  tc::Stepper s = scene.stepper();
  s.add_joints(std::make_unique<Rows>(s.bodies()));
  s.add_force("spring and weight", [](tc::BodySet& b, double, double h) {
    const double torque = c * (b.position[phi_M].x() - b.position[phi_S].x());
    b.motion[phi_M].velocity.x() -= h * torque / J_M;
    b.motion[phi_S].velocity.x() += h * torque / J_S;
    b.motion[y].velocity.z() -= h * kGravity;
    b.motion[bird].velocity.z() -= h * kGravity;
  });
  const Vector3d q(0, -6e-4 / 0.0058, -0.2788), v(-0.3411, 0, -7.4583);
  for (const Line& line : kLines) {
    s.bodies().position[at(line.body)] += Vector3d(line.x.dot(q), 0, line.z.dot(q));
    s.bodies().motion[at(line.body)].velocity = Vector3d(line.x.dot(v), 0, line.z.dot(v));
  }
  s.bodies().position[phi_M].x() = q[1];
  s.bodies().position[phi_S].x() = q[2];
  s.bodies().motion[phi_M].velocity.x() = v[1];
  s.bodies().motion[phi_S].velocity.x() = v[2];
  return s;
}

// Largest part of (0.01 m, 0.2 rad, 0.2 rad) that (y, phi_M, phi_S) are off by.
double error(const tc::Stepper& s, double y_, double phi_M_, double phi_S_) {
  return std::max({std::abs(position(s, y).z() - y_) / 0.01,
                   std::abs(position(s, phi_M).x() - phi_M_) / 0.2,
                   std::abs(position(s, phi_S).x() - phi_S_) / 0.2});
}

}  // namespace woodpecker

// At t = 0.2: fixed steps of 2e-6 and parts within 1e-6 and 1e-7 agree to 6e-4 of the scales.
const std::array<double, 3> kLate{-0.0236968, -6e-4 / 0.0058, -0.32596};

}  // namespace

TEST_CASE("woodpecker: steps in parts keep their accuracy at little work") {
  // At t = 0.1: states by events at two tolerances, which agree to 4e-11.
  const auto [accuracy, wanted, most] =
      GENERATE(std::array<double, 3>{1e-3, 1e-2, 1000}, std::array<double, 3>{1e-4, 2e-3, 2500},
               std::array<double, 3>{1e-5, 1e-3, 7000});
  const double dt = GENERATE(1e-2, 2e-3);
  tc::Stepper s = woodpecker::make(dt, accuracy);
  CAPTURE(accuracy, dt);
  while (s.time() < 0.1 - dt / 2) s.step();
  CHECK(woodpecker::error(s, -0.00705933034423, 0.0207247690364, 0.00752887681468) < wanted);
  while (s.time() < 0.2 - dt / 2) s.step();
  CHECK(woodpecker::error(s, kLate[0], kLate[1], kLate[2]) < wanted);
  CHECK(s.counts().contact_problems < most * (dt < 5e-3 ? 1.3 : 1));
  CHECK(s.counts().unsolved == 0);
}

TEST_CASE("woodpecker: fixed steps converge with order 1 over two decades") {
  std::array<double, 3> error{};
  double dt = 4e-4;
  for (double& each : error) {
    tc::Stepper s = woodpecker::make(dt, 0);
    while (s.time() < 0.1 - dt / 2) s.step();
    each = woodpecker::error(s, -0.00705933034423, 0.0207247690364, 0.00752887681468);
    dt /= 10;
  }
  INFO("errors " << error[0] << " " << error[1] << " " << error[2]);
  CHECK(error[0] / error[1] == Approx(10).epsilon(0.05));
  CHECK(error[1] / error[2] == Approx(10).epsilon(0.05));
}

TEST_CASE("woodpecker: fixed steps have the same error over dt at every step") {
  // At t = 0.2 by the event engine; 1e-9 and 1e-11 agree to 1e-9.
  std::vector<double> parts;
  for (const int steps : {200, 295, 430, 930, 2000, 4300}) {
    tc::Stepper s = woodpecker::make(0.2 / steps, 0);
    for (int k = 0; k < steps; ++k) s.step();
    parts.push_back(woodpecker::error(s, -0.0236982821988, -0.1034482758621, -0.3260130297557) *
                    steps / 0.2);
    CHECK(s.counts().contact_problems < steps);
  }
  const auto [least, most] = std::minmax_element(parts.begin(), parts.end());
  INFO("errors over dt from " << *least << " to " << *most);
  CHECK(*most < 520);  // without cuts 138 to 756
  CHECK(*most < 1.15 * *least);
}

TEST_CASE("accurate steps: a ball bounces until it rests, at the times of the closed form") {
  const double e = GENERATE(0.5, 0.9), accuracy = GENERATE(1e-3, 1e-5), size = GENERATE(1.0, 1e-4);
  const double g = kGravity, h = size, R = 0.1 * size, unit = std::sqrt(size);
  Scene scene(0.05 * unit);
  scene.options.accuracy = accuracy;
  scene.friction(0, e);
  scene.ground();
  const int ball = scene.sphere(R, 1, Vector3d(0, 0, R + h));
  tc::Stepper s = scene.stepper();
  const double fall = std::sqrt(2 * h / g), rest = fall * (1 + e) / (1 - e);
  CAPTURE(e, accuracy, size);
  // The height between two bounces.
  const auto height = [&](double t) {
    double start = -fall, v = g * fall;
    while (t > start + 2 * v / g) {
      start += 2 * v / g;
      v *= e;
      if (v < 1e-6 * g * fall) return 0.0;
    }
    return v * (t - start) - g * (t - start) * (t - start) / 2;
  };
  double worst = 0;
  while (s.time() < 1.1 * rest) {
    s.step();
    worst = std::max(worst, std::abs(position(s, ball).z() - R - height(s.time())));
  }
  CHECK(worst < 20 * accuracy * h);
  CHECK(std::abs(velocity(s, ball).z()) < 1e-9 * unit);
  CHECK(s.counts().sub_steps + s.counts().rejected < 3000 / std::sqrt(accuracy / 1e-3));
  CHECK(s.counts().unsolved == 0);
}

TEST_CASE("accurate steps: a block on a belt sticks, slips and comes back to the belt's speed") {
  // x'' + x = 0.3 on a belt of speed 1: sticks from x = 0 to t = 0.3, then x = 0.3 + sin(t - 0.3),
  // which meets the belt's speed again at 0.3 + 2 pi without sticking.
  const double accuracy = GENERATE(1e-3, 1e-4);
  Scene scene(0.05);
  scene.options.gravity = Vector3d(0, 0, -1);
  scene.options.accuracy = accuracy;
  scene.meetings = {{0, 1, 0.3, 0}};
  const int belt = scene.bodies.add(1e12, 1e12 * Matrix3d::Identity(), Vector3d::Zero(),
                                    Quaterniond::Identity(), Vector3d(1, 0, 0));
  tc::Shape slab = tc::Shape::sphere(1e4);
  slab.position = Vector3d(0, 0, -1e4);
  scene.surfaces.push_back({belt, slab, 1});
  const int block = scene.bodies.add(1, 1e6 * Matrix3d::Identity(), Vector3d(0, 0, 0.5),
                                     Quaterniond::Identity(), Vector3d(1, 0, 0));
  scene.surfaces.push_back({block, tc::Shape::sphere(0.5), 0});
  tc::Stepper s = scene.stepper();
  s.add_force("spring", [&](tc::BodySet& b, double, double dt) {
    b.motion[at(block)].velocity.x() -= dt * b.position[at(block)].x();
    b.motion[at(belt)].velocity.z() = 0;  // a belt does not fall
  });
  double worst = 0;
  while (s.time() < 7) {
    s.step();
    const double t = s.time();
    worst =
        std::max(worst, std::abs(position(s, block).x() - (t < 0.3 ? t : 0.3 + std::sin(t - 0.3))));
  }
  CAPTURE(accuracy);
  CHECK(worst < 20 * accuracy);
  CHECK(s.counts().sub_steps < 500 / std::sqrt(accuracy / 1e-3));
}

TEST_CASE("accurate steps: free tops keep momentum and energy; memory goes on with the same bits") {
  Scene scene(0.05);
  scene.options.accuracy = 1e-5;
  scene.friction(0.3, 0.3);
  scene.ground();
  scene.bodies.add(1, Vector3d(1, 2, 2.5).asDiagonal().toDenseMatrix(), Vector3d(5, 0, 50),
                   Quaterniond(AngleAxisd(0.3, Vector3d(1, 1, 0).normalized())), Vector3d(1, 0, 0),
                   Vector3d(0.1, 2, 0.1));
  scene.box({0.3, 0.2, 0.1}, 1, {0, 0, 0.4},
            Quaterniond(AngleAxisd(0.7, Vector3d(1, 0.3, 0).normalized())));
  tc::Stepper s = scene.stepper();
  const auto spin = [&] {
    tc::BodySet one = s.bodies();
    for (std::size_t i = 0; i < one.mass.size(); ++i)
      if (i != 1) one.motion[i].velocity = one.motion[i].angular_velocity = Vector3d::Zero();
    one.motion[1].velocity.setZero();
    return std::make_pair(tc::kinetic_energy(one), tc::angular_momentum(one));
  };
  const auto start = spin();
  for (int k = 0; k < 20; ++k) s.step();
  CHECK(spin().first == Approx(start.first).epsilon(1e-12));
  CHECK((spin().second - start.second).norm() < 1e-12 * start.second.norm());
  tc::Stepper again = scene.stepper();
  again.bodies() = s.bodies();
  again.set_memory(s.memory());
  for (int k = 0; k < 20; ++k) {
    s.step();
    again.step();
  }
  for (int i = 1; i < 3; ++i) {
    CHECK(position(s, i) == position(again, i));
    CHECK(angular_velocity(s, i) == angular_velocity(again, i));
  }
  CHECK_THROWS_AS(
      [] {
        Scene wrong;
        wrong.options.accuracy = 0.2;
        wrong.stepper();
      }(),
      std::invalid_argument);
}

namespace {

// A ball joint between a point of a body and the origin.
class Pivot : public tc::JointEquations {
 public:
  Pivot(int body, const Vector3d& arm) : body_(body), arm_(arm) {}
  int rows() const override { return 3; }
  void values(const tc::BodySet& b, double, double* g) override {
    Eigen::Map<Vector3d>{g} = b.position[at(body_)] + b.orientation[at(body_)] * arm_;
  }
  void add_rows(const tc::BodySet& b, double, tc::JointRows& rows) override {
    const Vector3d arm = b.orientation[at(body_)] * arm_;
    for (int k = 0; k < 3; ++k) {
      rows.add(0, 0);
      Vector6d G;
      G << Vector3d::Unit(k), arm.cross(Vector3d::Unit(k));
      rows.on(body_, G);
    }
  }

 private:
  int body_;
  Vector3d arm_;
};

}  // namespace

TEST_CASE("accurate steps: a pendulum that turns by more than a radian in a step") {
  // J th'' = -m g l sin th, by steps of Runge and Kutta's order 4.
  constexpr double l = 0.5, J = 0.1 + l * l, kGravity = 9.81, kEnd = 1.5;
  double angle = 0, rate = 20;
  constexpr int kSteps = 20000;
  for (int k = 0; k < kSteps; ++k) {
    const double h = kEnd / kSteps;
    const auto slope = [&](double th) { return -kGravity * l / J * std::sin(th); };
    const double a1 = slope(angle), r2 = rate + h / 2 * a1, a2 = slope(angle + h / 2 * rate),
                 r3 = rate + h / 2 * a2, a3 = slope(angle + h / 2 * r2), r4 = rate + h * a3,
                 a4 = slope(angle + h * r3);
    angle += h / 6 * (rate + 2 * r2 + 2 * r3 + r4);
    rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  const double accuracy = GENERATE(1e-2, 1e-3, 1e-4);
  CAPTURE(accuracy);
  Scene scene(0.075);
  scene.options.gravity = Vector3d(0, 0, -kGravity);
  scene.options.accuracy = accuracy;
  const int bob =
      scene.bodies.add(1, 0.1 * Matrix3d::Identity(), Vector3d(0, 0, -l), Quaterniond::Identity(),
                       Vector3d(20 * l, 0, 0), Vector3d(0, -20, 0));
  tc::Stepper s = scene.stepper();
  s.add_joints(std::make_unique<Pivot>(bob, Vector3d(0, 0, l)));
  while (s.time() < kEnd - 1e-9) s.step();
  // As many sub-steps as 1 / sqrt(accuracy), each of which may err by the accuracy.
  CHECK((position(s, bob) - l * Vector3d(std::sin(angle), 0, -std::cos(angle))).norm() <
        2 * std::sqrt(accuracy));
  CHECK(s.counts().sub_steps < 2000 / std::sqrt(accuracy / 1e-3));
}

TEST_CASE("accurate steps: the shortest part is that of the step, whatever a memory says") {
  for (const double next : {1e-300, 1e-15, 1e-11}) {
    INFO("next part " << next);
    Scene scene(1e-2);
    scene.options.accuracy = 1e-4;
    scene.friction(0.3, 0.5);
    scene.ground();
    scene.sphere(0.1, 1, {0, 0, 0.105}, {1, 0, -0.5});
    tc::Stepper s = scene.stepper();
    tc::StepperMemory memory = s.memory();
    memory.control.next = next;
    s.set_memory(memory);
    s.step();
    CHECK(s.time() == Approx(1e-2).epsilon(1e-14));
    CHECK(s.counts().sub_steps < 2002);
  }
}
