// Rolling and torsional friction: blocks against their law, motions against closed forms.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <random>
#include <set>

#include "joints/body_cones.hpp"
#include "joints/cone_islands.hpp"
#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

struct RollingContact {
  tc::PointContact point;
  double rolling = 0, torsional = 0;
  Vector3d impulse = Vector3d::Zero(), moment = Vector3d::Zero();  // on `first`, world axes
};

RollingContact contact_at(int first, int second, const Vector3d& r1, const Vector3d& r2,
                          const Vector3d& n, double mu, double rolling, double torsional) {
  RollingContact c;
  c.point.first = first;
  c.point.second = second;
  c.point.r1 = r1;
  c.point.r2 = r2;
  c.point.normal = n;
  c.point.mu = mu;
  c.rolling = rolling;
  c.torsional = torsional;
  return c;
}

tc::detail::BodyCones::Result solve(const std::vector<tc::RigidBody>& bodies, double tolerance,
                                    std::vector<RollingContact>& contacts) {
  tc::Options options;
  options.law = tc::Law::coulomb;
  options.tolerance = tolerance;
  tc::detail::Mechanisms none;
  none.update(bodies, {});
  std::vector<tc::Vector6d> v;
  for (const tc::RigidBody& body : bodies) v.push_back(body.velocities());
  std::vector<tc::detail::BodyCone> cones;
  Eigen::Index rows = 0;
  for (const RollingContact& c : contacts) {
    cones.push_back(tc::detail::contact_cone(c.point, c.rolling, c.torsional));
    rows += cones.back().cone.rows;
  }
  tether::linalg::VectorX x = Eigen::VectorXd::Zero(rows);
  const tc::detail::BodyCones::Result out = tc::detail::BodyCones(options).solve(none, cones, v, x);
  rows = 0;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const tc::detail::BodyCone& c = cones[k];
    const int moments = c.cone.rows - 3;
    const tc::detail::BodyCone::Rows& J = c.terms.front().J;
    contacts[k].impulse = J.topLeftCorner(3, 3).transpose() * x.segment<3>(rows);
    contacts[k].moment = J.bottomRightCorner(moments, 3).transpose() * x.segment(rows + 3, moments);
    rows += c.cone.rows;
  }
  return out;
}

// A ball of the scene's default rolling on z = 0 towards +x.
struct Rolling {
  double c, spin;
  Scene scene;
  int ball;
  Rolling(double rolling, double torsional, double dt, double speed, double turn)
      : c(rolling), spin(torsional), scene(dt) {
    scene.meetings = {{0, 1, 0.5, 0, rolling, torsional}};
    scene.ground();
    ball = scene.sphere(kRadius, 2, {0, 0, kRadius}, {speed, 0, 0}, {0, speed / kRadius, turn});
  }
  static constexpr double kRadius = 0.1;
};

double energy(const tc::Stepper& s) {
  double e = tc::kinetic_energy(s.bodies());
  for (std::size_t i = 0; i < s.bodies().position.size(); ++i)
    e += s.bodies().mass[i] * kGravity * s.bodies().position[i].z();
  return e;
}

}  // namespace

TEST_CASE("rolling: one block is solved to round-off for any body, arm and bounds") {
  std::mt19937 g(3);
  std::uniform_real_distribution<double> u(-1, 1), part(0, 1);
  const auto any = [&] { return Vector3d(u(g), u(g), u(g)); };
  int touching = 0;
  double worst = 0;
  for (int k = 0; k < 2000; ++k) {
    tc::RigidBody body;
    body.inverse_mass = std::pow(10, u(g));
    const Vector3d moments = Vector3d(1 + part(g), 1 + part(g), 1 + part(g)) * 3;
    const Quaterniond q = Quaterniond(u(g), u(g), u(g), u(g)).normalized();
    body.inverse_inertia = q.toRotationMatrix() * moments.asDiagonal() *
                           q.toRotationMatrix().transpose() * body.inverse_mass;
    body.velocity = any() + Vector3d(0, 0, -1);
    body.angular_velocity = any();
    const double kinds = part(g);
    std::vector<RollingContact> contacts = {
        contact_at(0, -1, 0.5 * any(), Vector3d::Zero(), Vector3d::UnitZ(), 0.6 * part(g),
                   kinds < 0.2 ? 0 : 0.3 * part(g), kinds > 0.8 ? 0 : 0.3 * part(g))};
    const tc::detail::BodyCones::Result s = solve({body}, 1e-13, contacts);
    INFO("problem " << k);
    worst = std::max(worst, s.error);
    const RollingContact& c = contacts[0];
    const Vector3d x = c.impulse, y = c.moment;
    const double n = x.z();
    touching += n > 0;
    // Bounds, and parts that oppose their velocity where they are reached.
    CHECK(x.head<2>().norm() <= c.point.mu * n * (1 + 1e-12));
    CHECK(y.head<2>().norm() <= c.rolling * n * (1 + 1e-12));
    CHECK(std::abs(y.z()) <= c.torsional * n * (1 + 1e-12));
    const Vector3d w = body.angular_velocity + body.inverse_inertia * (c.point.r1.cross(x) + y);
    CHECK(y.head<2>().dot(w.head<2>()) ==
          Approx(-c.rolling * n * w.head<2>().norm()).margin(1e-10));
    CHECK(y.z() * w.z() == Approx(-c.torsional * n * std::abs(w.z())).margin(1e-10));
  }
  CHECK(touching > 1000);
  CHECK(worst < 1e-12);
}

TEST_CASE("rolling: a ball slows down by 5/7 g c/r and stops where it should") {
  const double c = 0.002, r = Rolling::kRadius, v0 = 0.5, dt = 1e-3;
  Rolling rolls(c, 0, dt, v0, 0);
  tc::Stepper s = rolls.scene.stepper();
  const double a = 5.0 / 7.0 * kGravity * c / r;
  run(s, 1);
  CHECK(velocity(s, rolls.ball).x() == Approx(v0 - a).epsilon(1e-12));
  CHECK(angular_velocity(s, rolls.ball).y() == Approx((v0 - a) / r).epsilon(1e-12));
  // |moment| = c x_n, against the rotation.
  REQUIRE(s.contact_moments().size() == 1);
  CHECK(s.contact_moments()[0].y() == Approx(-c * 2 * kGravity * dt).epsilon(1e-12));
  run(s, 4);
  // v0^2/(2 a) less v0 dt/2, as for a block that slides; the last step is cut.
  CHECK(position(s, rolls.ball).x() ==
        Approx(v0 * v0 / (2 * a) - v0 * dt / 2).margin(a * dt * dt / 7));
  CHECK(velocity(s, rolls.ball).norm() < 1e-12);
  CHECK(s.counts().unsolved == 0);
}

TEST_CASE("rolling: torsional friction stops a spinning ball after 2/5 r^2 w/(c g)") {
  const double c = 0.004, r = Rolling::kRadius, w0 = 20, dt = 1e-3;
  Rolling spins(0, c, dt, 0, w0);
  tc::Stepper s = spins.scene.stepper();
  const double slow = c * kGravity / (0.4 * r * r);  // rad/s^2
  run(s, 1);
  CHECK(angular_velocity(s, spins.ball).z() == Approx(w0 - slow).epsilon(1e-12));
  run(s, w0 / slow - 1 - 2 * dt);
  CHECK(angular_velocity(s, spins.ball).z() > 0);
  run(s, 4 * dt);
  CHECK(angular_velocity(s, spins.ball).norm() < 1e-12);
  CHECK(position(s, spins.ball).head<2>().norm() < 1e-12);
}

TEST_CASE("rolling: a ball on a slope starts to roll where tan(angle) > c/r") {
  const double c = 0.02, r = 0.1;
  for (const double part : {1 - 1e-6, 1 + 1e-6, 1.5}) {
    const double angle = std::atan(part * c / r);
    const Quaterniond slope(AngleAxisd(angle, Vector3d(0.6, 0.8, 0)));
    Scene scene(1e-3);
    scene.meetings = {{0, 1, 0.8, 0, c, 0}};
    scene.ground(slope * Vector3d::UnitZ());
    const int ball = scene.sphere(r, 1, slope * Vector3d(0, 0, r));
    tc::Stepper s = scene.stepper();
    run(s, 1);
    // a = 5/7 g (sin - c/r cos), and the sum of the scheme.
    const double a =
        std::max(0.0, 5.0 / 7.0 * kGravity * (std::sin(angle) - c / r * std::cos(angle)));
    INFO("part " << part);
    CHECK((position(s, ball) - slope * Vector3d(0, 0, r)).norm() ==
          Approx(a * 1e-6 * 500 * 1001).margin(1e-11));
  }
}

TEST_CASE("rolling: without any length the answers are those of the ordinary solver") {
  std::mt19937 g(7);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<tc::RigidBody> bodies;
  std::vector<RollingContact> contacts;
  std::vector<tc::PointContact> points;
  for (int k = 0; k < 5; ++k) {
    tc::RigidBody body;
    body.inverse_mass = 1;
    body.inverse_inertia = 10 * Matrix3d::Identity();
    body.velocity = Vector3d(u(g), u(g), -1);
    body.angular_velocity = Vector3d(u(g), u(g), u(g));
    bodies.push_back(body);
    contacts.push_back(
        contact_at(k, k - 1, {0, 0, -0.5}, {0, 0, k > 0 ? 0.5 : 0}, Vector3d::UnitZ(), 0.4, 0, 0));
    points.push_back(contacts.back().point);
  }
  CHECK(solve(bodies, 1e-12, contacts).status == tc::Status::solved);
  tc::BodyOptions options;
  options.law = tc::Law::coulomb;
  options.tolerance = 1e-12;
  const tc::BodySolution t = tc::BodySolver(options).solve(bodies, points);
  for (std::size_t k = 0; k < 5; ++k) CHECK((contacts[k].impulse - t.impulses[k]).norm() < 1e-9);
}

TEST_CASE("rolling: a heap never gains energy and comes to rest") {
  Scene scene(2e-3);
  scene.meetings = {{0, 0, 0.5, 0, 0.01, 0.01}, {0, 1, 0.5, 0, 0.01, 0.01}};
  scene.ground();
  scene.options.tolerance = 1e-6;
  scene.options.acceptance = 100;
  // Four balls with a fifth on top: without rolling friction it rolls apart for ever.
  for (int k = 0; k < 4; ++k)
    scene.sphere(0.1, 1, {0.1005 * (k % 2 == 0 ? 1 : -1), 0.1005 * (k < 2 ? 1 : -1), 0.1});
  scene.sphere(0.1, 1, {0.004, 0.002, 0.26}, {0, 0, 0}, {1, 2, 3});
  tc::Stepper s = scene.stepper();
  double before = energy(s);
  for (int k = 0; k < 1500; ++k) {
    s.step();
    const double now = energy(s);
    CHECK(now <= before + 1e-7);
    before = now;
  }
  CHECK(s.counts().unsolved == 0);
  CHECK(s.counts().accepted <= 2);
  CHECK(tc::kinetic_energy(s.bodies()) < 1e-10);
}

TEST_CASE(
    "rolling: a heap takes a few times the sweeps of the same heap without, from step to step") {
  long sweeps[2];
  for (const bool rolls : {false, true}) {
    Scene scene(2e-3);
    const double c = rolls ? 0.002 : 0;
    scene.meetings = {{0, 0, 0.5, 0, c, c}, {0, 1, 0.5, 0, c, c}};
    scene.ground();
    scene.options.tolerance = 1e-6;
    std::mt19937 g(1);
    std::uniform_real_distribution<double> u(-5e-3, 5e-3);
    for (int k = 0; k < 64; ++k)
      scene.sphere(0.05, 1,
                   {0.101 * (k % 4) + u(g), 0.101 * (k / 4 % 4) + u(g), 0.05 + 0.095 * (k / 16)});
    tc::Stepper s = scene.stepper();
    for (int k = 0; k < 60; ++k) s.step();
    CHECK(s.contacts().points.size() > 100);
    CHECK(s.counts().accepted + s.counts().unsolved == 0);
    sweeps[rolls] = s.counts().sweeps;
  }
  CHECK(sweeps[1] < 5 * sweeps[0]);
}

TEST_CASE("rolling: a stepper that is given the memory of another goes on by its bits") {
  Scene scene(2e-3);
  scene.meetings = {{0, 0, 0.5, 0, 0.002, 0.001}, {0, 1, 0.5, 0, 0.002, 0.001}};
  scene.ground();
  scene.options.tolerance = 1e-6;
  for (int k = 0; k < 9; ++k)
    scene.sphere(0.1, 1, {0.19 * (k % 3) + 0.01 * k, 0.2 * (k / 3), 0.1 + 0.05 * (k % 2)});
  tc::Stepper whole = scene.stepper(), part = scene.stepper();
  run(whole, 0.1);
  part.bodies() = whole.bodies();
  part.set_memory(whole.memory());
  for (int k = 0; k < 10; ++k) {
    whole.step();
    part.step();
  }
  REQUIRE(whole.contact_moments().size() > 9);
  for (std::size_t i = 0; i < whole.contact_moments().size(); ++i)
    CHECK(whole.contact_moments()[i] == part.contact_moments()[i]);
  for (int i = 0; i < whole.bodies().size(); ++i) CHECK(velocity(whole, i) == velocity(part, i));
}

TEST_CASE(
    "rolling: impulses, moments and laws of 16 million surfaces have identities of their own") {
  std::set<std::uint64_t> ids = {tc::PointContact::kNoId};
  std::size_t expected = 1;
  const int surfaces[] = {0, 1, 2, 0x3fffff, 0x400000, 0x400001, 0x800000, 0x800001, 0xffffff};
  for (const int first : surfaces)
    for (const int second : surfaces)
      for (const int feature : {0, 1, 0xffff}) {
        if (first >= second) continue;
        const std::uint64_t id = tc::contact_id(first, second, feature);
        ids.insert({id, tc::detail::moment_id(id)});
        expected += 2;
      }
  for (const int law : {0, 1, 2, 0xffff, 0x10000, 0x10001, 0x7fffffff}) {
    ids.insert(tc::detail::LawRows::id(law));
    ++expected;
  }
  CHECK(ids.size() == expected);
}

TEST_CASE("rolling: what it does not go with is refused by name") {
  Scene scene(1e-3);
  scene.meetings = {{0, 1, 0.5, 0, 0.01, 0}};
  scene.ground();
  scene.sphere(0.1, 1, {0, 0, 0.1});
  scene.options.law = tc::Law::maximum_dissipation;
  CHECK_THROWS_WITH(scene.stepper(), Catch::Contains("coulomb, not maximum_dissipation"));
  scene.options.law = tc::Law::coulomb;
  scene.options.restitution_law = tc::RestitutionLaw::poisson;
  CHECK_THROWS_WITH(scene.stepper(), Catch::Contains("restitution_law = newton"));
  scene.options.restitution_law = tc::RestitutionLaw::newton;
  scene.meetings[0].rolling = -1;
  CHECK_THROWS_WITH(scene.stepper(), Catch::Contains("rolling"));
}

TEST_CASE("rolling: contacts on which sweeps of their six rows cycle are solved") {
  // Five spheres, each touching half of the others, and the floor.
  for (unsigned seed = 0; seed < 60; ++seed) {
    CAPTURE(seed);
    std::mt19937 g(seed);
    std::uniform_real_distribution<double> u(-1, 1);
    std::vector<tc::RigidBody> bodies;
    std::vector<RollingContact> contacts;
    std::vector<Vector3d> at;
    for (int k = 0; k < 5; ++k) {
      at.emplace_back(u(g), u(g), 1 + 0.9 * u(g));
      tc::RigidBody b;
      b.inverse_mass = std::pow(10, u(g));
      b.inverse_inertia = Eigen::Matrix3d::Identity() * 2.5 * b.inverse_mass / 0.01;
      b.velocity = Vector3d(u(g), u(g), u(g) - 1);
      b.angular_velocity = 10 * Vector3d(u(g), u(g), u(g));
      bodies.push_back(b);
    }
    for (int i = 0; i < 5; ++i)
      for (int j = -1; j < i; ++j) {
        if (j >= 0 && u(g) > 0) continue;
        const std::size_t a = static_cast<std::size_t>(i);
        const Vector3d n = j < 0 ? Vector3d::UnitZ()
                                 : Vector3d((at[a] - at[static_cast<std::size_t>(j)]).normalized());
        const double mu = 0.3 + 0.7 * std::abs(u(g)), c = 0.02 * std::abs(u(g)),
                     d = 0.02 * std::abs(u(g));
        contacts.push_back(
            contact_at(i, j, -0.1 * n, j < 0 ? Vector3d::Zero() : Vector3d(0.1 * n), n, mu, c, d));
      }
    CHECK(solve(bodies, 1e-9, contacts).status == tc::Status::solved);
  }
}
