// Islands that sleep: what they cost, what they report, and what wakes them.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <tether/contact/joints.hpp>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using tc::Shape;
using tc::Vector6d;

constexpr double kEdge = 0.2, kMass = 1.5;

// Stacks of three boxes on the ground, or on a table.
Scene stacks(int count, double sleep, double lift = 0) {
  Scene scene(1e-3);
  scene.options.sleep = sleep;
  scene.friction(0.5);
  for (int k = 0; k < count; ++k)
    for (int j = 0; j < 3; ++j)
      scene.box(Vector3d::Constant(kEdge), kMass, Vector3d(k, 0, lift + (j + 0.5) * kEdge));
  return scene;
}

tc::Stepper stepper(const Scene& scene) { return scene.stepper(); }

// Sum of the vertical impulses on and by a body.
double pressed(const tc::Stepper& s, int body) {
  double sum = 0;
  const tc::StepContacts& c = s.contacts();
  for (std::size_t k = 0; k < c.points.size(); ++k) {
    if (c.points[k].first == body) sum += c.impulses[k].z();
    if (c.points[k].second == body) sum -= c.impulses[k].z();
  }
  return sum;
}

bool same(const tc::BodySet& a, const tc::BodySet& b) {
  for (std::size_t i = 0; i < a.position.size(); ++i)
    if (a.position[i] != b.position[i] || a.orientation[i].coeffs() != b.orientation[i].coeffs() ||
        a.motion[i].velocity != b.motion[i].velocity ||
        a.motion[i].angular_velocity != b.motion[i].angular_velocity)
      return false;
  return true;
}

// A body that moves along x only, by s(t).
class Driven : public tc::JointEquations {
 public:
  Driven(int body, const Vector3d& at, double from) : body_(body), at_(at), from_(from) {}
  int rows() const override { return 6; }
  void values(const tc::BodySet& b, double t, double* g) override {
    const auto i = static_cast<std::size_t>(body_);
    Vector3d d = b.position[i] - at_;
    d.x() -= 0.5 * std::pow(late(t), 2);
    for (int k = 0; k < 3; ++k) g[k] = d[k];
    for (int k = 0; k < 3; ++k) g[3 + k] = 2 * b.orientation[i].vec()[k];
  }
  void add_rows(const tc::BodySet&, double t, tc::JointRows& rows) override {
    for (int k = 0; k < 6; ++k) {
      rows.add(0, k == 0 ? late(t) : 0);
      rows.on(body_, Vector6d::Unit(k));
    }
  }

 private:
  double late(double t) const { return std::max(0.0, t - from_); }
  int body_;
  Vector3d at_;
  double from_;
};

}  // namespace

TEST_CASE("sleep: stacks at rest cost nothing, stay to the last bit and press as before") {
  Scene scene = stacks(4, 1e-3);
  scene.ground();
  tc::Stepper s = stepper(scene);
  run(s, 0.1);
  CHECK(s.asleep() == 0);  // 5 sqrt(s / g) = 0.66 s
  const double dt = s.options().step;
  run(s, 0.9);
  REQUIRE(s.asleep() == 12);
  const tc::BodySet before = s.bodies();
  const long problems = s.counts().contact_problems;
  run(s, 1);
  CHECK(s.counts().contact_problems == problems);
  CHECK(same(s.bodies(), before));
  for (int i = 0; i < 12; ++i) {
    CHECK(pressed(s, i) == Approx(kMass * kGravity * dt).epsilon(1e-6));
    CHECK(velocity(s, i).isZero(0));
  }
}

TEST_CASE("sleep: until the first body sleeps, and switched off, every bit is as without") {
  Scene off = stacks(2, 0), on = stacks(2, 1e-3);
  off.ground();
  on.ground();
  tc::Stepper a = stepper(off), b = stepper(on);
  for (int k = 0; k < 600; ++k) {
    a.step();
    b.step();
    REQUIRE(b.asleep() == 0);
    REQUIRE(same(a.bodies(), b.bodies()));
  }
  run(a, 1);
  CHECK(a.asleep() == 0);
}

TEST_CASE("sleep: a ball that is thrown wakes the stack that it hits, and no other") {
  std::vector<Vector3d> tops;
  for (const double sleep : {0.0, 1e-3}) {
    Scene scene = stacks(3, sleep);
    const int ball = scene.sphere(0.1, 2, {-6, 0.02, 3}, {0, 0, 0});
    scene.ground();
    tc::Stepper s = stepper(scene);
    s.bodies().position[static_cast<std::size_t>(ball)].z() = 1000;  // falls from far
    run(s, 1.5);
    CHECK(s.asleep() == (sleep > 0 ? 9 : 0));
    s.bodies().position[static_cast<std::size_t>(ball)] = Vector3d(-0.5, 0.02, 0.5);
    s.bodies().motion[static_cast<std::size_t>(ball)].velocity = Vector3d(4, 0, 0.5);
    int least = 9;
    for (int k = 0; k < 150; ++k) {
      s.step();
      least = std::min(least, s.asleep());
    }
    if (sleep > 0) CHECK(least == 6);
    tops.push_back(position(s, 2));
    tops.push_back(position(s, 8));
  }
  // Boxes that tumble make 1e-9 grow.
  CHECK((tops[0] - tops[2]).norm() < 1e-3);
  CHECK(std::abs(tops[0].x()) > 0.1);
  CHECK((tops[1] - tops[3]).norm() < 1e-6);
}

TEST_CASE("sleep: what lies on a table wakes when the table begins to move") {
  std::vector<double> places;
  for (const double sleep : {0.0, 1e-3}) {
    Scene scene = stacks(1, sleep, 0.1);
    const int table = scene.box({2, 2, 0.1}, 10, Vector3d(0, 0, 0.05));
    tc::Stepper s = stepper(scene);
    s.add_joints(std::make_unique<Driven>(table, Vector3d(0, 0, 0.05), 2));
    const double dt = s.options().step;
    run(s, 1.9);
    CHECK(s.asleep() == (sleep > 0 ? 3 : 0));
    CHECK(s.joint_impulses()[2] == Approx((10 + 3 * kMass) * kGravity * dt).epsilon(1e-6));
    run(s, 0.6);  // by 1 m/s^2, less than friction holds
    CHECK(s.asleep() == 0);
    CHECK(velocity(s, 0).x() == Approx(0.5).epsilon(2e-3));
    CHECK(velocity(s, 2).x() == Approx(0.5).epsilon(2e-3));
    places.push_back(position(s, 2).x());
  }
  CHECK(std::abs(places[0] - places[1]) < 1e-5);
}

TEST_CASE("sleep: a fixed table that the caller moves wakes what lies on it") {
  Scene scene = stacks(1, 1e-3, 0.1);
  const int table = scene.bodies.add_fixed(Vector3d(0, 0, 0.05));
  scene.surfaces.push_back({table, Shape::box({2, 2, 0.1}), 1});
  tc::Stepper s = stepper(scene);
  run(s, 1);
  REQUIRE(s.asleep() == 3);
  SECTION("by its velocity: a belt that starts") {
    s.bodies().motion[static_cast<std::size_t>(table)].velocity = Vector3d(0.3, 0, 0);
    run(s, 0.3);
    CHECK(velocity(s, 0).x() > 0.2);  // the stack rocks on it
  }
  SECTION("by its place") {
    s.bodies().position[static_cast<std::size_t>(table)].z() -= 1;
    run(s, 0.3);
    CHECK(velocity(s, 0).z() == Approx(-0.3 * kGravity).epsilon(1e-6));
  }
  SECTION("and so does who moves a body of it") {
    s.bodies().motion[2].velocity = Vector3d(0, 1, 0);
    s.step();
    CHECK(velocity(s, 2).y() > 0.9);
  }
  CHECK(s.asleep() == 0);
}

TEST_CASE("sleep: a stack falls when the force that carries it ends") {
  Scene scene = stacks(1, 1e-3);
  const int shelf = scene.box({1, 1, 0.1}, 2, Vector3d(0, 0, -0.05));
  const double weight = (2 + 3 * kMass) * kGravity;
  tc::Stepper s = stepper(scene);
  s.add_force("lift", [=](tc::BodySet& b, double t, double dt) {
    const double left = std::clamp(2 - t, 0.0, dt);
    b.motion[static_cast<std::size_t>(shelf)].velocity.z() += left * weight / 2;
  });
  run(s, 1.9);
  CHECK(s.asleep() == 4);
  CHECK(pressed(s, 0) == Approx(kMass * kGravity * s.options().step).epsilon(1e-6));
  const double top = position(s, 2).z();
  run(s, 0.5);
  CHECK(s.asleep() == 0);
  CHECK(velocity(s, 2).z() == Approx(-0.4 * kGravity).epsilon(1e-3));
  CHECK(position(s, 2).z() - top == Approx(-0.08 * kGravity).epsilon(1e-2));
}

TEST_CASE("sleep: a continued run has the same bits, asleep and when it wakes") {
  Scene scene = stacks(2, 1e-3);
  const int ball = scene.sphere(0.1, 2, {-3.5, 0, 0.35}, {0, 0, 0});
  scene.ground();
  const auto throw_it = [&](tc::Stepper& s) {
    s.bodies().position[static_cast<std::size_t>(ball)] = Vector3d(-0.5, 0, 0.4);
    s.bodies().motion[static_cast<std::size_t>(ball)].velocity = Vector3d(2, 0, 0);
  };
  tc::Stepper whole = stepper(scene);
  const long saved_at = GENERATE(400, 700, 1200);
  tc::Stepper second = stepper(scene);
  for (long k = 0; k < 1600; ++k) {
    if (k == 1300) throw_it(whole);
    if (k == saved_at) {
      second.bodies() = whole.bodies();
      second.set_memory(whole.memory());
    }
    whole.step();
    if (k < saved_at) continue;
    if (k == 1300) throw_it(second);
    second.step();
    REQUIRE(same(whole.bodies(), second.bodies()));
    REQUIRE(whole.asleep() == second.asleep());
  }
  CHECK(whole.counts().steps == second.counts().steps);
}

TEST_CASE("sleep: what it does not go with is refused by name") {
  using Catch::Matchers::Contains;
  Scene scene = stacks(1, 1e-3);
  scene.ground();
  scene.options.accuracy = 1e-3;
  CHECK_THROWS_WITH(stepper(scene), Contains("sleep does not go with an accuracy"));
  scene.options.accuracy = 0;
  scene.options.gravity.reset();
  CHECK_THROWS_WITH(stepper(scene), Contains("sleep needs gravity"));
  scene.options.gravity = Vector3d(0, 0, -kGravity);
  scene.meetings[0].rolling = 0.01;
  CHECK_THROWS_WITH(stepper(scene), Contains("sleep does not go with rolling"));
}

TEST_CASE("sleep: a load of 2e-4 of the weight wakes a stack that has slept for a while") {
  Scene scene = stacks(1, 1e-3);
  scene.ground();
  for (const double push : {0.0, 2e-4 * kMass * kGravity}) {
    tc::Stepper s = stepper(scene);
    s.add_force("push", [=](tc::BodySet& b, double t, double dt) {
      if (t >= 3) b.motion[2].velocity.x() += dt * push / kMass;
    });
    run(s, 2.9);
    CHECK(s.asleep() == 3);
    run(s, 0.2);
    CHECK(s.asleep() == (push > 0 ? 0 : 3));
  }
}
