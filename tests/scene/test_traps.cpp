// Tether: scenes and contact problems in a program that traps invalid operations, divisions by zero
// and overflow. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <tether/contact.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "assemblies.hpp"
#include "support/catch.hpp"
#include "support/skip.hpp"
#include "support/traps.hpp"
#include "texts.hpp"

using namespace tether;
namespace fs = std::filesystem;

namespace {

std::vector<fs::path> shipped() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(TETHER_SHIPPED_SCENES))
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// False where the scene needs a part that is not built here.
bool runs(scene::Scene scene, double end) {
  scene.output = scene::Output{};
  scene.end = std::min(scene.end, end);
  for (scene::Expect& each : scene.expect) each.time = std::min(each.time, scene.end);
  try {
    scene::make_engine(scene);
  } catch (const std::invalid_argument&) {
    return false;
  }
  INFO(scene.name);  // Catch2 names it when SIGFPE ends the test
  const test::Traps traps;
  CHECK(scene::run(scene).failure.empty());
  return true;
}

}  // namespace

TEST_CASE("every shipped scene runs in a program that traps") {
  if (!test::kHasTraps) TETHER_SKIP("no feenableexcept here");
  int ran = 0;
  for (const fs::path& file : shipped()) ran += runs(scene::read_scene(file.string()), 0.3);
  CHECK(ran >= 8);
}

TEST_CASE("a box under every law, friction and restitution runs in a program that traps") {
  if (!test::kHasTraps) TETHER_SKIP("no feenableexcept here");
  int ran = 0;
  for (const char* law : {"coulomb", "maximum_dissipation"})
    for (const char* friction : {"0", "0.3", "2.5"})
      for (const char* restitution : {"0", "0.7"}) {
        std::string text = texts::with(texts::kTouching, "maximum_dissipation", law);
        text = texts::with(text, "friction = 0.3", std::string("friction = ") + friction);
        text = texts::with(text, "restitution = 0.5", std::string("restitution = ") + restitution);
        text = texts::with(text, "position = [0, 0, 0.25]",
                           "position = [0, 0, 0.6]\nangular_velocity = [3, 1, 2]");
        ran += runs(scene::parse_scene(text, "touching.toml"), 0.5);
      }
  CHECK(ran == 12);
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
