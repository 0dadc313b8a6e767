// Impacts that an impact causes within the same step. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

}  // namespace

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
