// Impacts that an impact causes within the same step. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

// A rod of 1 kg and 1 m that falls at 1 m/s, its ends so far above the ground, in parts of the way
// of a step. A step that is cut has its impacts one by one: see test_stepping_cuts.
struct LandingRod {
  Scene scene;
  int body = 0;
  LandingRod(double dt, double restitution, double first_gap, double second_gap, double yaw)
      : scene(dt) {
    scene.options.gravity.reset();
    scene.options.near_part = 1;  // the second end is beyond the way of the fall
    scene.options.cut_at_impacts = false;
    scene.friction(0, restitution);
    scene.ground();
    const Quaterniond turn(AngleAxisd(yaw, Vector3d::UnitZ()));
    // No slope: the end that comes later is a foot that is shorter.
    const Vector3d first = turn * Vector3d(-0.5, 0, 0),
                   second = turn * Vector3d(0.5, 0, (second_gap - first_gap) * dt);
    body = scene.bodies.add(1, Matrix3d::Identity() / 12, Vector3d(0, 0, first_gap * dt),
                            Quaterniond::Identity(), Vector3d(0, 0, -1));
    scene.surfaces.push_back({body, tc::Shape::touching_points({first, second}), 0});
  }
};

}  // namespace

TEST_CASE("stepping: a rod whose second end strikes within the step has two whole impacts") {
  // 1/m + a^2/I = 4, 1/m - a^2/I = -2: an end that comes with w and leaves with -e w takes
  // (1 + e) w / 4, and the other end is changed by -2 of that.
  const double e = 0.5, second = 1 + 2 * (1 + e) / 4, first_impulse = (1 + e) / 4,
               second_impulse = second * (1 + e) / 4;
  for (const tc::Law law : {tc::Law::coulomb, tc::Law::maximum_dissipation})
    for (const double dt : {1e-2, 1e-3, 1e-4})
      for (const double gap : {0.85, 0.9, 0.97})
        for (const double later : {1.02, 1.2, 1.45}) {
          const double yaw = 3 * later;
          LandingRod rod(dt, e, gap, later, yaw);
          rod.scene.options.law = law;
          tc::Stepper s = rod.scene.stepper();
          s.step();
          INFO("dt " << dt << " gaps " << gap << " " << later);
          CHECK(velocity(s, rod.body).z() ==
                Approx(-1 + first_impulse + second_impulse).margin(1e-9));
          CHECK(velocity(s, rod.body).head<2>().norm() < 1e-9);
          const Vector3d axis(-std::sin(yaw), std::cos(yaw), 0);
          CHECK(angular_velocity(s, rod.body).dot(axis) ==
                Approx(6 * (first_impulse - second_impulse)).margin(1e-8));
          CHECK(s.counts().bounces == 2);
          CHECK(s.counts().contact_problems <= 4);
          CHECK(s.contacts().impulses.at(0).z() + s.contacts().impulses.at(1).z() ==
                Approx(first_impulse + second_impulse).margin(1e-9));
        }
}

TEST_CASE("stepping: a rod lands on one end, then on the other, and lies at the surface") {
  for (const double dt : {1e-2, 1e-3})
    for (const double later : {0.91, 1.02, 1.04, 1.3}) {
      LandingRod rod(dt, 0, 0.9, later, 0.4);
      tc::Stepper s = rod.scene.stepper();
      s.step();
      INFO("dt " << dt << " later " << later);
      // Turning about the first end after 0.9 of the step the other comes with 1.5 m/s, or 0.15 of
      // the way of the step; else it strikes in the next one.
      const double speed = later < 1.05 ? 0 : 1.5;
      CHECK(velocity(s, rod.body).z() == Approx(-speed / 2).margin(1e-8));
      s.step();
      s.step();
      CHECK(velocity(s, rod.body).norm() + angular_velocity(s, rod.body).norm() < 1e-7);
      for (const double gap : s.contacts().gaps) CHECK(gap == Approx(0).margin(1e-4 * dt));
    }
}

TEST_CASE("stepping: a row of balls with small gaps passes one impact after another on in a step") {
  const double R = 0.1, gap = 5e-5, dt = 1e-3;
  const int n = GENERATE(2, 3, 6, 12);
  const double e = GENERATE(1.0, 0.8);
  Scene scene(dt);
  scene.options.gravity.reset();
  scene.friction(0, e);
  const Vector3d along = Vector3d(1, 2, -0.5).normalized();
  for (int k = 0; k < n; ++k)
    scene.sphere(R, 1, k * (2 * R + gap) * along, k == 0 ? Vector3d(along) : Vector3d::Zero());
  tc::Stepper s = scene.stepper();
  s.step();
  // Each ball leaves the one before with (1 - e) / 2 of its speed and goes on with (1 + e) / 2.
  double speed = 1;
  for (int k = 0; k < n; ++k) {
    const double left = k + 1 < n ? speed * (1 - e) / 2 : speed;
    INFO("ball " << k << " of " << n << ", e " << e);
    CHECK(velocity(s, k).dot(along) == Approx(left).margin(1e-8));
    CHECK((velocity(s, k) - left * along).norm() < 1e-8);
    speed *= (1 + e) / 2;
  }
  CHECK(s.counts().unsolved == 0);
  CHECK(s.counts().contact_problems <= n + 1);
}

TEST_CASE("stepping: a ball that is sent off stops at what it could not reach before") {
  // Slow bodies have contacts near them only; a fast one sends the second through a gap that its
  // own velocity would not have covered, and that one the third.
  const double R = 0.1;
  const bool cut = GENERATE(true, false);
  for (const double scale : {1e-3, 1.0, 1e3})
    for (const double dt : {1e-2, 5e-3})
      for (const double e : {0.0, 0.5}) {
        Scene scene(dt);
        scene.options.gravity.reset();
        scene.options.cut_at_impacts = cut;
        scene.friction(0.3, e);
        const Vector3d along = Vector3d(1, -0.4, 0.2).normalized();
        for (int k = 0; k < 4; ++k)
          scene.sphere(R * scale, k == 0 ? 20 : 1,
                       (k * (2 * R + 5e-3) - (k > 0 ? 4.9e-3 : 0)) * scale * along,
                       k == 0 ? Vector3d(8 * scale * along) : Vector3d::Zero());
        scene.surfaces.push_back({scene.bodies.add_fixed(4 * (2 * R + 5e-3) * scale * along),
                                  tc::Shape::plane(-along), 1});
        tc::Stepper s = scene.stepper();
        double deepest = 0;
        for (int k = 0; k < 8; ++k) {
          s.step();
          deepest = std::max(deepest, s.penetration());
        }
        CAPTURE(scale, dt, e, cut);
        CHECK(deepest < 2e-3 * R * scale);
        CHECK(s.counts().unsolved == 0);
        CHECK(s.counts().contact_problems < (cut ? 80 : 60));  // an impact has two of its own
      }
}
