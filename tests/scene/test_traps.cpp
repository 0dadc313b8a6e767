// Tether: contacts in a program that traps invalid operations, divisions by zero and overflow, as
// all shipped scenes run (CMakeLists.txt). SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>
#include <tether/contact.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>

#include "assemblies.hpp"
#include "support/catch.hpp"
#include "support/skip.hpp"
#include "support/traps.hpp"
#include "texts.hpp"

using namespace tether;

TEST_CASE("a box under every law, friction and restitution runs in a program that traps") {
  if (!test::kHasTraps) TETHER_SKIP("no feenableexcept here");
  for (const char* law : {"coulomb", "maximum_dissipation"})
    for (const char* friction : {"0", "0.3", "2.5"})
      for (const char* restitution : {"0", "0.7"}) {
        std::string text = texts::with(texts::kTouching, "maximum_dissipation", law);
        text = texts::with(text, "friction = 0.3", std::string("friction = ") + friction);
        text = texts::with(text, "restitution = 0.5", std::string("restitution = ") + restitution);
        text = texts::with(text, "position = [0, 0, 0.25]",
                           "position = [0, 0, 0.6]\nangular_velocity = [3, 1, 2]");
        scene::Scene scene = scene::parse_scene(text, "touching.toml");
        scene.end = 0.5;
        scene.expect.clear();
        INFO(text);  // Catch2 says it when SIGFPE ends the test
        const test::Traps traps;
        CHECK(scene::run(scene).failure.empty());
      }
}

TEST_CASE("contact problems are solved in a program that traps") {
  if (!test::kHasTraps) TETHER_SKIP("no feenableexcept here");
  using namespace contact;
  for (const double mu : {0.0, 0.3, 1.0})
    for (const Law law : {Law::coulomb, Law::maximum_dissipation, Law::frictionless}) {
      INFO("mu " << mu << ", " << name(law));
      contact::random::Generator g(17);
      Options options;
      options.law = law;
      options.max_work = 2e6;
      BodyOptions by_bodies;
      by_bodies.law = law;
      by_bodies.max_sweeps = 300;
      for (int k = 0; k < 12; ++k) {
        const Problem problem = contact::random::cluster(g, mu, 3 + k, 4 + 2 * k).problem();
        contact::random::RigidAssembly stack =
            contact::random::rigid_stack(3 + 2 * k, std::pow(10, k / 3), mu);
        for (RigidBody& body : stack.bodies) {
          body.velocity += 0.1 * g.vector();
          if (k % 3 == 0) body.velocity.setZero();
        }
        const test::Traps traps;
        Solver(options).solve(problem);
        BodySolver(by_bodies).solve(stack.bodies, stack.contacts);
      }
    }
}
