// Tether: smooth step sizes where IDA looks for its first one. SPDX-License-Identifier:
// BSD-3-Clause
#include <limits>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// F fails once, at the first evaluation after t.
Problem failing_once(Problem problem, double after, bool* failed) {
  *failed = false;
  problem.residual = [F = problem.residual, after, failed](double t, const double* y,
                                                           const double* yp, double* r) {
    F(t, y, yp, r);
    if (*failed || !(t > after)) return;
    *failed = true;
    r[0] = std::numeric_limits<double>::quiet_NaN();
  };
  return problem;
}

}  // namespace

TEST_CASE("smooth steps: a step that fails early costs few others, in forms of index 2") {
  for (const Problem& problem :
       {pendulum(1.0, 9.81, 5.0, "index 2"), pendulum(1.0, 9.81, 5.0, "GGL")})
    for (const double tolerance : {1e-4, 1e-5, 1e-7}) {
      INFO(problem.name << " " << problem.form << ", " << tolerance);
      const Run whole = integrate(problem, tolerance, problem.recommended_constraints());
      REQUIRE(whole.flag >= 0);
      // In its first steps, hundreds of times shorter than later ones.
      bool failed = false;
      const Run cut = integrate(failing_once(problem, 3e-3 * tolerance, &failed), tolerance,
                                problem.recommended_constraints());
      REQUIRE(failed);
      REQUIRE(cut.flag >= 0);
      CHECK(cut.statistics.smoothing_begun == 1);
      CAPTURE(whole.steps, cut.steps, whole.error, cut.error);
      CHECK(cut.steps <= whole.steps + 12);
      CHECK(cut.error <= 3.0 * whole.error);
    }
}
