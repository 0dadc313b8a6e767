// Tether: smooth step sizes where IDA looks for its first one. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <limits>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "motions.hpp"
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

TEST_CASE(
    "smooth steps: at loose tolerances and low orders less is asked for, in forms of index 2") {
  // 20 to 30 steps each; with one setpoint for all orders 1.29 times plain IDA's.
  double steps = 0.0, of_plain = 0.0, log_error = 0.0;
  for (const char* form : {"index 2", "GGL"}) {
    Problem problem = points_on_sphere(12, form, 1.0);
    problem.reference = integrate(problem, 1e-10, problem.recommended_constraints()).y;
    problem.error_components = 6 * 12;  // positions and velocities
    for (const double tolerance : {1e-3, 7e-4, 5e-4, 4e-4, 3e-4, 2e-4}) {
      const Run run = integrate(problem, tolerance, problem.recommended_constraints());
      const Run plain = integrate_suppressed(problem, tolerance);
      REQUIRE(run.flag >= 0);
      REQUIRE(plain.flag >= 0);
      CHECK(run.statistics.smoothing_begun == 1);
      steps += static_cast<double>(run.steps);
      of_plain += static_cast<double>(plain.steps);
      log_error += std::log(run.error / plain.error);
    }
  }
  CAPTURE(steps, of_plain, log_error);
  CHECK(steps <= 1.22 * of_plain);
  CHECK(log_error <= 0.0);
}
