// Tether: test problems with references: error, drift at every step, work.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

struct Limits {
  double tolerance, error;
  long steps;
  double round_off;  // of |g| when the projection's own tolerance is 1e-10
};

/// Drift at every accepted step within the projection's own tolerance, at round-off when that is
/// tightened; error and steps as measured, with a factor of about two.
void check(const Problem& problem, const tp::Constraints& rows, const Limits& limits) {
  INFO(problem.name << ", " << problem.form << ", tolerance " << limits.tolerance);
  const Run run = integrate(problem, limits.tolerance, rows);
  INFO("status " << tp::to_string(run.status) << " " << run.message);
  REQUIRE(run.flag >= 0);
  CHECK(run.error <= limits.error);
  CHECK(run.steps <= limits.steps);
  // Weights of 1e-10 make the rounding of y itself up to a thousandth of a tolerance.
  const double rounding = 2e-13 / limits.tolerance;
  CHECK(run.distance <= std::max(tp::Options().advanced.tolerance, rounding));

  tp::Options tight;
  tight.advanced.tolerance = 1e-10;
  const Run at_round_off = integrate(problem, limits.tolerance, rows, tight);
  REQUIRE(at_round_off.flag >= 0);
  CHECK(at_round_off.drift <= limits.round_off);
  CHECK(at_round_off.error <= limits.error);
  CHECK(at_round_off.steps <= limits.steps);
}

}  // namespace

TEST_CASE("pendulum against its exact motion") {
  for (const char* form : {"index 1", "index 1 x2", "index 1 w", "index 0"}) {
    const Problem p = pendulum(1.0, 1.0, 100.0, form);
    const tp::Constraints rows = p.recommended_constraints();
    check(p, rows, {1e-4, 3e-3, 2000, 4e-13});
    check(p, rows, {1e-6, 4e-5, 4200, 4e-12});
    check(p, rows, {1e-8, 4e-7, 7400, 1e-14});
  }
  const Problem index0 = pendulum(1.0, 1.0, 100.0, "index 0");
  check(index0, index0.recommended_constraints(), {1e-6, 9e-6, 2800, 4e-12});
  const Problem seed = pendulum(1.1, 9.80665, 10.0, "index 1");
  check(seed, seed.recommended_constraints(), {1e-8, 3e-8, 2400, 1e-13});
}

TEST_CASE("car axis against its reference") {
  for (const char* form : {"index 1", "index 1 w"}) {
    const Problem p = car_axis(form);
    const tp::Constraints rows = p.recommended_constraints();
    check(p, rows, {1e-6, 4e-4, 2000, 5e-13});
    check(p, rows, {1e-8, 1.5e-5, 4000, 2e-14});
  }
  const Problem p = car_axis("index 1");
  check(p, p.recommended_constraints(), {1e-10, 3e-7, 5200, 1e-14});
}

TEST_CASE("Andrews' squeezer with its energy") {
  for (const char* form : {"index 1", "index 1 w"}) {
    const Problem p = andrews(form);
    const tp::Constraints rows = p.select({"position", "velocity", "energy"});
    check(p, rows, {1e-4, 3e-5, 400, 3e-13});
    check(p, rows, {1e-6, 1e-6, 500, 2e-12});
    check(p, rows, {1e-8, 3e-9, 1500, 1e-13});
  }
  const Problem p = andrews("index 1");
  check(p, p.select({"position", "velocity", "energy"}), {1e-10, 2e-10, 2100, 1e-13});
}

TEST_CASE("slider crank from a consistent start") {
  const Problem p = slider_crank("index 1");
  const tp::Constraints rows = p.recommended_constraints();
  check(p, rows, {1e-4, 1e-5, 1700, 1e-10});
  check(p, rows, {1e-6, 3e-8, 4700, 3e-12});
}

TEST_CASE("slider crank from its published start, which is not consistent") {
  const Problem published = slider_crank("index 1", false), consistent = slider_crank("index 1");
  const tp::Constraints rows = published.recommended_constraints();
  Host host(published, 1e-6);
  host.attach(rows);
  const tp::ConsistencyReport report = host.projection().make_consistent(0.0, host.y, host.yp);
  INFO(report.message);
  REQUIRE(report);
  CHECK(report.drift_before > 1e-10);
  CHECK(report.drift_before < 2e-8);
  CHECK(report.drift_after < 1e-13);
  CHECK(report.largest_change < 1e-2);  // a multiplier of 382
  double drift = 0.0;
  while (host.t < published.t_end) {
    REQUIRE(host.step() >= 0);
    drift = std::max(drift, distance(host, rows));
  }
  IDAGetDky(host.ida, published.t_end, 0, host.y);
  CHECK(drift <= tp::Options().advanced.tolerance);
  CHECK(consistent.error(host.data()) < 2e-8);
  CHECK(host.steps() <= 4700);
}

TEST_CASE("Robertson with its linear invariant") {
  for (const char* form : {"index 1", "index 0"}) {
    for (const double t_end : {40.0, 4e5}) {
      const Problem p = robertson(t_end, form);
      check(p, p.recommended_constraints(), {1e-6, 6e-7, 900, 2e-14});
      check(p, p.recommended_constraints(), {1e-8, 1e-8, 1500, 2e-14});
    }
  }
}

TEST_CASE("torque-free body: quaternion norm, energy and momentum, with a redundant row") {
  for (const char* motion : {"regular", "euler", "dzhanibekov"}) {
    const Problem p = rigid_body(motion, 10.0);
    // |L| in the body frame says what the space vector says, times what |q| says.
    const double L2 = std::string(motion) == "regular" ? 10.0
                      : std::string(motion) == "euler" ? 14.0
                                                       : 4.0001;
    const tp::Constraints magnitude = row(
        "magnitude of momentum",
        [L2](double, const double* y) {
          return (y[4] * y[4] + 4.0 * y[5] * y[5] + 9.0 * y[6] * y[6] - L2) / 2.0;
        },
        [](double, const double* y, double* c) {
          c[4] = y[4];
          c[5] = 4.0 * y[5];
          c[6] = 9.0 * y[6];
        });
    const tp::Constraints rows = p.recommended_constraints() + magnitude;
    check(p, rows, {1e-6, 3e-5, 300, 1e-11});
    check(p, rows, {1e-8, 1e-7, 800, 1e-13});
    const Run run = integrate(p, 1e-6, rows, {}, false), plain = integrate_plain(p, 1e-6);
    CHECK(run.statistics.rank_drops == run.statistics.factorizations);
    CHECK(run.error < 3.0 * plain.error);
  }
}
