// Masonry arches: least thickness and least friction, by linear programs for their equilibrium.
// SPDX-License-Identifier: BSD-3-Clause
#include "stepping_stacks.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

}  // namespace

TEST_CASE("stepping: masonry arch stands and falls within 1.5 percent of its least thickness") {
  struct Case {
    int n;
    double least;
  };
  const Case c = GENERATE(Case{7, 0.0962450}, Case{21, 0.1067899});
  const bool arcs = GENERATE(true, false);
  {
    const Scene scene = arch(1e-3, c.n, 1.015 * c.least, 10, arcs);
    tc::Stepper s = scene.stepper();
    run(s, 1);
    CHECK(largest_move(s, scene.bodies) < 1e-9);
  }
  {
    Scene scene = arch(1e-3, c.n, 0.985 * c.least, 10, arcs);
    scene.options.tolerance = 1e-6;
    tc::Stepper s = scene.stepper();
    run(s, 0.3);
    CHECK(largest_move(s, scene.bodies) > 3e-3);
  }
}

TEST_CASE("stepping: arches of other numbers and shapes of stones") {
  struct Case {
    int n;
    double least;
    bool arcs;
  };
  // Least t/R of stones between arcs, and between chords.
  const Case c =
      GENERATE(Case{5, 0.0966069, true}, Case{15, 0.1062658, true}, Case{6, 0.1041, false},
               Case{10, 0.107011, false}, Case{20, 0.107348, false});
  INFO(c.n << " voussoirs, arcs " << c.arcs);
  CHECK(stands(arch(1e-2, c.n, 1.015 * c.least, 10, c.arcs)));
  CHECK_FALSE(stands(arch(1e-2, c.n, 0.985 * c.least, 10, c.arcs)));
}

TEST_CASE("stepping: an arch slips at the friction of the table") {
  struct Case {
    int n;
    double thickness, mu;
  };
  const Case c =
      GENERATE(Case{7, 0.15, 0.3340393}, Case{15, 0.15, 0.3465698}, Case{21, 0.15, 0.3495184},
               Case{7, 0.12, 0.3618882}, Case{15, 0.12, 0.3780367}, Case{21, 0.12, 0.3800265});
  INFO(c.n << " voussoirs, t/R " << c.thickness);
  CHECK(stands(arch(1e-2, c.n, c.thickness, c.mu * 1.01)));
  CHECK_FALSE(stands(arch(1e-2, c.n, c.thickness, c.mu * 0.99)));
}

TEST_CASE("stepping: an arch of 20 stones between chords slips at the friction of the table") {
  struct Case {
    double thickness, mu;
  };
  const Case c = GENERATE(Case{0.12, 0.38245}, Case{0.2, 0.30888});
  INFO("t/R " << c.thickness);
  CHECK(stands(arch(1e-2, 20, c.thickness, c.mu * 1.01, false)));
  CHECK_FALSE(stands(arch(1e-2, 20, c.thickness, c.mu * 0.99, false)));
}

TEST_CASE(
    "stepping: an arch of 20 stones at mu = 0.7 stands for 10 s at t/R = 0.12, falls at 0.1") {
  const Scene thick = arch(1e-2, 20, 0.12, 0.7, false);
  tc::Stepper s = thick.stepper();
  run(s, 10);
  CHECK(largest_move(s, thick.bodies) < 1e-9);
  Scene thin = arch(1e-2, 20, 0.1, 0.7, false);
  thin.options.tolerance = 1e-6;
  tc::Stepper t = thin.stepper();
  run(t, 0.6);
  CHECK(largest_move(t, thin.bodies) > 1e-2);
}
