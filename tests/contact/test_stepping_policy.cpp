// Contact problems that are not solved: accepted, taken in shorter steps, used all the same.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

// A stack of balls in a corner; two sweeps do not solve it, and nothing else is allowed.
Scene hard(double tolerance, double acceptance, int max_halvings) {
  Scene scene(1e-2);
  scene.options.tolerance = tolerance;
  scene.options.acceptance = acceptance;
  scene.options.max_halvings = max_halvings;
  scene.options.cut_at_impacts = false;  // its attempts would be among those counted
  scene.options.max_sweeps = 2;
  scene.options.min_sweeps = 0;
  scene.options.max_assembled = 0;
  scene.friction(0.4);
  scene.ground();
  for (int k = 0; k < 6; ++k) scene.sphere(0.5, 1 + k, {0.05 * (k % 2), 0, 0.5 + 0.999 * k});
  return scene;
}

}  // namespace

TEST_CASE("stepping: a problem above the tolerance is accepted within the factor, and counted") {
  tc::Stepper strict = hard(1e-12, 1, 0).stepper(), tolerant = hard(1e-12, 1e12, 0).stepper();
  run(strict, 0.1);
  CHECK(strict.counts().accepted == 0);
  CHECK(strict.counts().unsolved == 10);
  CHECK(!strict.succeeded());
  CHECK(strict.status() != tc::Status::solved);
  // Never above a hundredth of the largest velocity that a contact needs.
  CHECK(tc::accepted_residual(tolerant.options()) == 1e-2);
  CHECK(tc::accepted_residual(strict.options()) == 1e-12);
  Scene loose = hard(3e-2, 1e12, 0);
  CHECK(tc::accepted_residual(loose.options) == 3e-2);
  // Accepted where the residual is within it, unsolved elsewhere; one or the other, always.
  Scene near = hard(1e-9, 1e5, 0);
  near.options.max_sweeps = 30;
  tc::Stepper s = near.stepper();
  long accepted = 0, unsolved = 0;
  for (int k = 0; k < 50; ++k) {
    s.step();
    const bool solved = s.status() == tc::Status::solved;
    CHECK(s.succeeded() == (solved || s.residual() <= 1e-4));
    accepted += !solved && s.residual() <= 1e-4;
    unsolved += !s.succeeded();
  }
  CHECK(s.counts().accepted == accepted);
  CHECK(s.counts().unsolved == unsolved);
  CHECK(accepted > 0);
}

TEST_CASE("stepping: a step that fails is taken in halves and quarters, forces at their times") {
  const Scene scene = hard(1e-14, 1, 2);
  tc::Stepper s = scene.stepper();
  double end = 0, last = 0;
  bool follows = true;
  int calls = 0;
  // Attempts go 1, 1/2, 1/4, 1/4, 1/2, 1/4, 1/4 of the step.
  s.add_force("watch", [&](tc::BodySet&, double time, double dt) {
    ++calls;
    follows = follows && (std::abs(time - last) < 1e-15 || std::abs(time - end) < 1e-15);
    last = time;
    end = time + dt;
  });
  for (int k = 0; k < 5; ++k) s.step();
  CHECK(s.counts().steps == 5);
  // A part whose warm start solves it at once stays whole.
  CHECK(s.counts().halved >= 13);
  CHECK(s.counts().halved <= 15);
  CHECK(s.counts().unsolved + s.counts().accepted > 0);
  CHECK(s.counts().unsolved + s.counts().accepted <= 20);
  CHECK(calls == 5 + 2 * s.counts().halved);
  CHECK(follows);
  CHECK(end == Approx(5e-2).epsilon(1e-12));
  CHECK(s.time() == Approx(5e-2).epsilon(1e-15));
  CHECK(s.succeeded() == (s.residual() <= 1e-4));
  // Free fall is that of the parts: an attempt that is taken again at its time has left no trace.
  Scene above = hard(1e-14, 1, 2);
  above.bodies.position[6].z() += 100;
  tc::Stepper free = above.stepper();
  double z = position(free, 6).z(), v = 0, z_before = z, v_before = v, begun = -1;
  free.add_force("watch", [&](tc::BodySet&, double time, double dt) {
    if (std::abs(time - begun) < 1e-15) {
      z = z_before;
      v = v_before;
    }
    begun = time;
    z_before = z;
    v_before = v;
    v -= kGravity * dt;
    z += v * dt;
  });
  run(free, 0.05);
  CHECK(free.counts().halved >= 13);
  CHECK(position(free, 6).z() == Approx(z).epsilon(1e-12));
}

TEST_CASE("stepping: halves start from impulses of their length, and leave those of the step") {
  const Scene scene = hard(1e-14, 1, 2);
  tc::Stepper s = scene.stepper();
  std::vector<tc::WarmStart> starts;  // of each attempt
  std::vector<double> lengths;
  s.add_force("watch", [&](tc::BodySet&, double, double dt) {
    starts.push_back(s.memory().contacts);
    lengths.push_back(dt);
  });
  const double step = s.options().step;
  int failed = 0;
  for (int k = 0; k < 5; ++k) {
    starts.clear();
    lengths.clear();
    s.step();
    // The impulses of the last part, as a step of the whole length would have them.
    const tc::WarmStart after = s.memory().contacts;
    REQUIRE(after.impulses.size() == s.contacts().impulses.size());
    for (std::size_t c = 0; c < after.impulses.size(); ++c) {
      const auto place = std::find(after.ids.begin(), after.ids.end(), s.contacts().points[c].id);
      REQUIRE(place != after.ids.end());
      const Vector3d& left = after.impulses[static_cast<std::size_t>(place - after.ids.begin())];
      CHECK(left == step / s.last_sub_step() * s.contacts().impulses[c]);
    }
    // An attempt that fails is followed by one of half its length, which knows nothing of it.
    for (std::size_t a = 0; a + 1 < starts.size(); ++a) {
      if (lengths[a + 1] != lengths[a] / 2 || starts[a].impulses.empty()) continue;
      ++failed;
      REQUIRE(starts[a + 1].ids == starts[a].ids);
      for (std::size_t c = 0; c < starts[a].impulses.size(); ++c)
        CHECK(starts[a + 1].impulses[c] == 0.5 * starts[a].impulses[c]);
    }
  }
  CHECK(failed >= 8);
}

TEST_CASE("stepping: solved problems are neither accepted nor halved") {
  Scene scene = hard(1e-9, 1e3, 4);
  scene.options.max_sweeps = 1000;
  scene.options.max_assembled = 1000;
  tc::Stepper s = scene.stepper();
  run(s, 0.5);
  CHECK(s.counts().accepted == 0);
  CHECK(s.counts().halved == 0);
  CHECK(s.counts().unsolved == 0);
  CHECK(s.succeeded());
  Scene bad = scene;
  bad.options.acceptance = 0.5;
  CHECK_THROWS_AS(bad.stepper(), std::invalid_argument);
  bad = scene;
  bad.options.max_halvings = -1;
  CHECK_THROWS_AS(bad.stepper(), std::invalid_argument);
}

TEST_CASE("stepping: what is accepted is not halved, and halving is no way to more residual") {
  Scene scene = hard(1e-12, 1e12, 2);
  scene.options.max_sweeps = 20;
  tc::Stepper s = scene.stepper();
  long accepted = 0;
  for (int k = 0; k < 50; ++k) {
    const long halved = s.counts().halved;
    s.step();
    CHECK(s.succeeded() == (s.residual() <= 1e-2));
    CHECK((s.counts().halved > halved || s.residual() <= 1e-2));
    accepted += s.counts().halved == halved && s.status() != tc::Status::solved;
  }
  CHECK(accepted > 0);
  CHECK(s.counts().accepted >= accepted);
}

// Ten times as much as is accepted at once: a motion that ends there loses more.
TEST_CASE("stepping: the shortest parts are used within 1e-3 where anything is accepted") {
  for (const bool accepts : {true, false}) {
    Scene scene = hard(1e-9, accepts ? 1e5 : 1, 2);
    scene.options.max_sweeps = 20;
    tc::Stepper s = scene.stepper();
    int between = 0, above = 0;
    for (int k = 0; k < 100; ++k) {
      s.step();
      between += s.residual() > 1e-4 && s.residual() <= 1e-3;
      above += s.residual() > 1e-3;
      CHECK(s.succeeded() == (s.residual() <= (accepts ? 1e-3 : 1e-4)));
    }
    INFO(between << " between, " << above << " above");
    CHECK(between > 0);
    CHECK(above > 0);
  }
}

// Far contacts are many where bodies are fast: they are swept with the others.
TEST_CASE("stepping: a pour of 6272 spheres leaves no step unsolved with 60 sweeps") {
  Scene scene(2e-3);
  scene.options.tolerance = 1e-5;
  scene.options.acceptance = 1000;
  scene.options.max_sweeps = 60;
  scene.friction(0.3);
  scene.ground();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&] {
    const double x = any(random), y = any(random), z = any(random);
    return Vector3d(x, y, z);
  };
  for (int k = 0; k < 14 * 14 * 32; ++k)
    scene.sphere(0.05, 1, 0.11 * Vector3d(k % 14, k / 14 % 14, k / 196 + 0.5) + 2e-3 * vector(),
                 Vector3d(0, 0, -1) + Vector3d(0.3, 0.3, 1).cwiseProduct(vector()));
  tc::Stepper s = scene.stepper();
  std::size_t most = 0;
  for (int k = 0; k < 40; ++k) {
    s.step();
    most = std::max(most, s.contacts().points.size());
  }
  CHECK(most > 8000);
  CHECK(s.counts().unsolved == 0);
  CHECK(s.penetration() < 1e-4);
}
