// Steps that are cut at impacts, as they are by default: exact where flights are, errors that go
// with the step, impulses that are those of the whole step, and runs that continue bit by bit.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <vector>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using tc::Shape;

// Height and velocity of a point that falls from h and bounces with e.
std::array<double, 2> bounced(double h, double e, double t) {
  const double g = kGravity;
  double z = h, v = 0;
  for (;;) {
    const double hit = (v + std::sqrt(v * v + 2 * g * z)) / g;
    if (hit > t) return {z + v * t - g * t * t / 2, v - g * t};
    v = e * (g * hit - v);
    z = 0;
    t -= hit;
  }
}

// Housner's block, 0.4 x 1.2, at an angle of 0.2 rad; it does not slip.
Scene block(double dt) {
  Scene scene(dt);
  scene.friction(100);
  scene.ground();
  const Quaterniond q(AngleAxisd(0.2, Vector3d::UnitY()));
  scene.bodies.add(1, Matrix3d::Identity() * 0.4 / 3, -(q * Vector3d(0.2, 0, -0.6)), q);
  scene.surfaces.push_back({1, Shape::touching_points({{0.2, 0, -0.6}, {-0.2, 0, -0.6}}), 0});
  return scene;
}

}  // namespace

TEST_CASE("cuts: a ball bounces along its parabolas at every step length") {
  const double e = GENERATE(1.0, 0.9, 0.5), dt = GENERATE(1e-2, 1.7e-3, 1e-3, 1e-4);
  Scene scene(dt);
  scene.friction(0.3, e);
  scene.ground(Vector3d(0, 0, 1));
  scene.sphere(0.1, 2, Vector3d(0, 0, 1.1));
  tc::Stepper s = scene.stepper();
  CAPTURE(e, dt);
  double impulses = 0;
  for (int k = 1; k <= 1.2 / dt; ++k) {
    s.step();
    for (const Vector3d& x : s.contacts().impulses) impulses += x.z();
    const auto [z, v] = bounced(1, e, s.time());
    REQUIRE(std::abs(position(s, 1).z() - 0.1 - z) < 1e-11);
    REQUIRE(std::abs(velocity(s, 1).z() - v) < 1e-10);
    REQUIRE(s.last_sub_step() == dt);
    REQUIRE(std::abs(velocity(s, 1).z() - (impulses / 2 - kGravity * s.time())) < 1e-10);
  }
  CHECK(s.counts().bounces == (e < 0.7 ? 3 : 1));
}

TEST_CASE("cuts: flights within steps, down to the slowest bounce") {
  // Steps of the length of up to fifteen bounces; what is too slow to bounce goes v^2 / 2 g high.
  const double e = GENERATE(0.9, 0.7, 0.3), dt = GENERATE(2e-2, 1e-2, 4e-3);
  Scene scene(dt);
  scene.friction(0, e);
  scene.ground();
  scene.sphere(0.1, 1, {0, 0, 0.35});
  tc::Stepper s = scene.stepper();
  const double slowest = scene.options.restitution_threshold * std::sqrt(kGravity * 0.1);
  const double zeno = std::sqrt(2 * 0.25 / kGravity) * (1 + e) / (1 - e);
  double largest = 0;
  while (s.time() < 1.2 * zeno) {
    s.step();
    const double z = s.time() < zeno ? bounced(0.25, e, s.time())[0] : 0;
    largest = std::max(largest, std::abs(position(s, 1).z() - 0.1 - z));
  }
  CAPTURE(e, dt, slowest * slowest / 2 / kGravity);
  CHECK(largest < slowest * slowest / 2 / kGravity);
  CHECK(velocity(s, 1).norm() < 1e-12);
}

TEST_CASE("cuts: what strikes leaves islands beside it as they are") {
  // A box that slides to rest and a ball that rolls, of which cuts would make other sums.
  const auto run_with = [](int balls, bool cut) {
    Scene scene(1e-3);
    scene.options.cut_at_impacts = cut;
    scene.meetings = {{0, 0, 0.3, 0}, {0, 1, 0.3, 0}, {1, 2, 0.3, 0.8}};
    scene.ground();
    scene.box({0.4, 0.3, 0.1}, 2, {0, 0, 0.05});
    scene.bodies.motion.back().velocity = {2, 0, 0};
    scene.sphere(0.1, 1, {0, 1, 0.1}, {1, 0, 0});
    for (int k = 0; k < balls; ++k) {
      scene.sphere(0.1, 1, {0, 2.0 + k, 0.4 + 0.07 * k});
      scene.surfaces.back().material = 2;
    }
    tc::Stepper s = scene.stepper();
    run(s, 0.6);
    std::vector<Vector3d> out;
    for (const int i : {1, 2}) {
      out.push_back(position(s, i));
      out.push_back(velocity(s, i));
      out.push_back(angular_velocity(s, i));
    }
    CHECK(s.counts().bounces >= balls);
    return out;
  };
  const std::vector<Vector3d> alone = run_with(0, false);
  const int balls = GENERATE(1, 3);
  const std::vector<Vector3d> beside = run_with(balls, true);
  for (std::size_t k = 0; k < alone.size(); ++k) CHECK(alone[k] == beside[k]);
}

TEST_CASE("cuts: a body that is sent to another one within the step strikes it there") {
  // Three balls that fall freely; the second is near the third by what the first gives it only.
  Scene scene(1e-2);
  scene.friction(0.3, 1);
  scene.sphere(0.1, 1, {0, 0, 9}, {40, 0, 0});
  scene.sphere(0.1, 1, {0.3, 0, 9});
  scene.sphere(0.1, 1, {0.62, 0, 9});
  tc::Stepper s = scene.stepper();
  run(s, 0.05);
  CHECK(std::abs(velocity(s, 0).x()) < 1e-9);
  CHECK(std::abs(velocity(s, 1).x()) < 1e-9);
  CHECK(velocity(s, 2).x() == Approx(40).epsilon(1e-12));
  // 0.1 m to the first, 0.12 m to the second impact.
  CHECK(position(s, 2).x() == Approx(0.62 + 40 * (0.05 - 0.0025 - 0.003)).epsilon(1e-10));
  CHECK(position(s, 2).z() == Approx(9 - kGravity * 0.05 * 0.05 / 2).epsilon(1e-12));
}

TEST_CASE("cuts: a spinning ball keeps to Newton's law and Coulomb's cone in every bounce") {
  // Capobianco et al. (2021), eN = 1/2: exact velocities, and places after three flights.
  const double dt = GENERATE(4e-3, 1e-3, 3e-4);
  Scene scene(dt);
  scene.friction(0.2, 0.5);
  scene.ground();
  scene.sphere(0.1, 1, {-0.5, 0, 1}, {1, 0, 0}, {0, -50, 0});
  tc::Stepper s = scene.stepper();
  run(s, 0.6);
  CHECK(velocity(s, 1).x() == Approx(-0.26064269323230522).epsilon(1e-11));
  CHECK(angular_velocity(s, 1).y() == Approx(-18.48393266919237).epsilon(1e-11));
  run(s, 0.36);
  CHECK(velocity(s, 1).x() == Approx(-5.0 / 7).epsilon(1e-11));
  const double t1 = 0.42835293687811934, t2 = 2 * t1;
  const double x = -0.5 + t1 - 0.26064269323230522 * t1 - 5.0 / 7 * (s.time() - t2);
  CHECK(std::abs(position(s, 1).x() - x) < 1e-11);
}

TEST_CASE("cuts: a rocking block has errors that go with the step") {
  // Tilt at 1 s, after two impacts, by Runge-Kutta and Housner's ratio 0.85.
  const double R = std::sqrt(0.4), alpha = std::atan(1.0 / 3), p2 = 0.75 * kGravity / R;
  double tilt = 0.2, rate = 0;
  const auto slope = [&](double x) { return -p2 * std::sin(alpha - x); };
  const auto move = [&](double h, double& x, double& w) {
    const double k1 = slope(x), k2 = slope(x + h / 2 * w), k3 = slope(x + h / 2 * (w + h / 2 * k1)),
                 k4 = slope(x + h * (w + h / 2 * k2));
    x += h * w + h * h / 6 * (k1 + k2 + k3);
    w += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  };
  double t = 0;
  for (const double stop : {0.478068508074417337, 1.0}) {
    const double h = (stop - t) / 2000;
    for (int k = 0; k < 2000; ++k) move(h, tilt, rate);
    t = stop;
    if (t == 1) break;
    REQUIRE(std::abs(tilt) < 1e-9);
    tilt = 0;
    rate = -0.85 * rate;
  }
  std::vector<double> parts;
  for (const int steps : {1000, 1600, 2500, 4000, 6300, 10000}) {
    tc::Stepper s = block(1.0 / steps).stepper();
    run(s, 1);
    const Quaterniond& q = s.bodies().orientation[1];
    parts.push_back(std::abs(2 * std::atan2(q.y(), q.w()) + tilt) * steps);
    CHECK(s.counts().contact_problems <= steps + 10);
  }
  const auto [least, most] = std::minmax_element(parts.begin(), parts.end());
  INFO("errors over dt from " << *least << " to " << *most);
  CHECK(*most < 4.5);  // without cuts 3.8 to 7.1
  CHECK(*most < 1.4 * *least);
}

TEST_CASE("cuts: the end of a rod that an impact sends down strikes at its own time") {
  // Gaps of 0.85 and 1.02 to 1.45 of the way in a step: after the first blow the other end comes at
  // 1.75 of its speed, which sends the first one down again, and all three impacts are whole
  // wherever they fall in the steps.
  const double e = 0.5, first = (1 + e) / 4, second = (1 + 2 * first) * (1 + e) / 4,
               third = (2 * second - e) * (1 + e) / 4;
  for (const double dt : {1e-2, 1e-3, 1e-4})
    for (const double later : {1.02, 1.2, 1.45}) {
      Scene scene(dt);
      scene.options.gravity.reset();
      scene.friction(0, e);
      scene.ground();
      const double tilt = std::asin((later - 0.85) * dt);
      const Quaterniond q(AngleAxisd(-tilt, Vector3d::UnitY()));
      const Vector3d a(0.5, 0, 0);
      // 1/m + a^2/I = 4 with m = 1.
      scene.bodies.add(1, Matrix3d::Identity() / 12, Vector3d(0, 0, 0.85 * dt) - q * -a, q,
                       {0, 0, -1});
      scene.surfaces.push_back({1, Shape::touching_points({a, -a}), 0});
      tc::Stepper s = scene.stepper();
      for (int k = 0; k < 2; ++k) s.step();
      CAPTURE(dt, later);
      CHECK(velocity(s, 1).z() == Approx(-1 + first + second + third).margin(2 * dt * dt));
      CHECK(s.counts().bounces == 3);
      CHECK(s.counts().contact_problems <= 5);
    }
}

TEST_CASE("cuts: a continued run has the same bits") {
  Scene scene = block(1e-3);
  scene.friction(0.5, 0.3);
  const int ball = scene.sphere(0.1, 1, {2, 0, 0.7}, {0.5, 0, 0}, {0, 3, 1});
  tc::Stepper whole = scene.stepper(), second = scene.stepper();
  for (int k = 0; k < 700; ++k) {
    if (k == 300) {
      second.bodies() = whole.bodies();
      second.set_memory(whole.memory());
    }
    whole.step();
    if (k < 300) continue;
    second.step();
    for (const int i : {1, ball}) {
      REQUIRE(position(whole, i) == position(second, i));
      REQUIRE(velocity(whole, i) == velocity(second, i));
      REQUIRE(angular_velocity(whole, i) == angular_velocity(second, i));
    }
  }
  CHECK(whole.counts().bounces > 0);
}

TEST_CASE("cuts: a body that a spring carries stays where it is") {
  Scene scene(1e-3);
  scene.friction(0);
  scene.ground();
  scene.sphere(0.1, 1, {0, 0, 1});
  tc::Stepper s = scene.stepper();
  s.add_force("spring", [](tc::BodySet& b, double, double dt) {
    b.motion[1].velocity.z() += dt * (kGravity - 40 * (b.position[1].z() - 1));
  });
  run(s, 5);
  CHECK(std::abs(position(s, 1).z() - 1) < 1e-12);
}

TEST_CASE("cuts: among many contacts a ball that bounces for itself is right, and costs a tenth") {
  // Six boxes at rest have 24 contacts; the same with balls that strike in every step.
  const auto scene = [](double dt) {
    Scene s(dt);
    s.meetings = {{0, 1, 0.3, 0.9}};
    s.ground();
    for (int k = 0; k < 6; ++k) s.box({0.4, 0.4, 0.2}, 1, {1.0 * k, 0, 0.1});
    return s;
  };
  for (const double dt : {4e-3, 1e-3}) {
    Scene one = scene(dt);
    const int ball = one.sphere(0.1, 2, {0, 3, 1.1});
    tc::Stepper s = one.stepper();
    while (s.time() < 3) s.step();
    CAPTURE(dt);
    const auto [z, v] = bounced(1, 0.9, s.time());
    CHECK(std::abs(position(s, ball).z() - 0.1 - z) < 1e-10);
    CHECK(std::abs(velocity(s, ball).z() - v) < 1e-9);
    for (int k = 1; k <= 6; ++k) CHECK(std::abs(position(s, k).z() - 0.1) < 1e-9);
  }
  Scene rain = scene(4e-3);
  for (int k = 0; k < 40; ++k) rain.sphere(0.05, 0.1, {0.3 * k, 5, 0.2 + 0.013 * k});
  Scene without = rain;
  without.options.cut_at_impacts = false;
  tc::Stepper s = rain.stepper(), t = without.stepper();
  run(s, 2);
  run(t, 2);
  CHECK(s.counts().bounces > 150);
  CHECK(s.counts().contact_problems < 1.15 * static_cast<double>(t.counts().contact_problems));
  CHECK(s.counts().unsolved == 0);
}

TEST_CASE("cuts: bodies that stick together are not struck by rounding") {
  // Without gravity the least speed of an impact is 0. Two balls meet without restitution.
  Scene scene(1e-2);
  scene.options.gravity.reset();
  scene.friction(0.3, 0);
  const Vector3d along = Vector3d(1, -0.4, 0.2).normalized();
  const int a = scene.sphere(0.1, 20, Vector3d::Zero(), 8 * along);
  const int b = scene.sphere(0.1, 1, 0.21 * along);
  tc::Stepper s = scene.stepper();
  run(s, 1);
  CHECK((velocity(s, a) - 160.0 / 21 * along).norm() < 1e-8);
  CHECK((velocity(s, b) - 160.0 / 21 * along).norm() < 1e-8);
  CHECK(s.counts().contact_problems < 110);
}
