// Tether: one motion in several forms, against plain IDA's best form. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "host.hpp"
#include "motions.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// Plain IDA with algebraic variables out of the error test.
Run suppressed(const Problem& problem, double tolerance) {
  Host host(problem, tolerance);
  REQUIRE(IDASetId(host.ida, host.vector(problem.id)) == 0);
  REQUIRE(IDASetSuppressAlg(host.ida, 1) == 0);
  Run run;
  run.flag = host.finish();
  run.steps = host.steps();
  run.error = run.flag >= 0 ? host.error() : std::numeric_limits<double>::infinity();
  return run;
}

Problem with_reference(Problem problem, const Problem& reduced,
                       const std::vector<std::string>& rows) {
  problem.reference = integrate(reduced, 1e-12, reduced.select(rows), {}, false).y;
  problem.reference.resize(static_cast<std::size_t>(problem.size),
                           std::numeric_limits<double>::quiet_NaN());
  return problem;
}

}  // namespace

TEST_CASE("spherical pendulum in forms of index 2 with all its invariants, down to 1e-10") {
  const Problem reduced = spherical_pendulum("index 0", 100.0);
  for (const char* form : {"GGL", "index 2"}) {
    const Problem problem =
        with_reference(spherical_pendulum(form, 100.0), reduced, reduced.recommended);
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-9, 1e-10}) {
      INFO(form << ", tolerance " << tolerance);
      const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
      REQUIRE(run.flag >= 0);
      CHECK(static_cast<double>(run.steps) <= 850.0 * std::pow(tolerance / 1e-4, -0.175));
      CHECK(run.error <= 150.0 * tolerance);
      CHECK(run.drift <= 1e-9);
    }
  }
}

TEST_CASE("points on a sphere in forms of index 2: never worse than plain IDA by a factor of two") {
  const Problem reduced = points_on_sphere(20, "index 0", 3.0);
  for (const char* form : {"GGL", "index 2"}) {
    const Problem problem = with_reference(points_on_sphere(20, form, 3.0), reduced, {"sphere"});
    for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-7}) {
      INFO(form << ", tolerance " << tolerance);
      const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
      const Run plain = suppressed(problem, tolerance);
      REQUIRE(run.flag >= 0);
      CHECK(run.error <= 2.0 * plain.error);
      CHECK(run.steps <= plain.steps);
    }
  }
}
