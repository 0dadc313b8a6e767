// Tether: sweeps over bodies: their least number. SPDX-License-Identifier:
// BSD-3-Clause
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "support/catch.hpp"

using namespace tether::contact;

namespace {

BodyOptions only_sweeps(double tolerance) {
  BodyOptions options;
  options.max_assembled = 0;
  options.tolerance = tolerance;
  options.max_sweeps = 100000;
  return options;
}

}  // namespace

TEST_CASE("sweeps: an island of more than 64 contacts gets min_sweeps, a smaller one does not") {
  for (const int boxes : {10, 40}) {  // 40 and 160 contacts
    const random::RigidAssembly stack = random::rigid_stack(boxes, 1);
    BodyOptions options = only_sweeps(0.5);
    const int usual = BodySolver(options).solve(stack.bodies, stack.contacts).sweeps;
    REQUIRE(usual < 37);
    options.min_sweeps = 37;
    const BodySolution s = BodySolver(options).solve(stack.bodies, stack.contacts);
    INFO(boxes << " boxes, " << usual << " sweeps without min_sweeps");
    CHECK(s.status == Status::solved);
    CHECK(s.sweeps == (boxes == 40 ? 37 : usual));
  }
}
