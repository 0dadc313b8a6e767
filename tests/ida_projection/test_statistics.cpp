// Tether: work counts that agree with each other and with IDA's. SPDX-License-Identifier:
// BSD-3-Clause
#include <chrono>
#include <problems/akzo_nobel.hpp>
#include <problems/pendulum.hpp>
#include <problems/robertson.hpp>
#include <sstream>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, ',');) fields.push_back(field);
  return fields;
}

}  // namespace

TEST_CASE("counts agree with each other") {
  for (const char* form : {"index 1", "index 0"})
    for (const double tolerance : {1e-4, 1e-8}) {
      INFO(form << ", tolerance " << tolerance);
      const Problem problem = pendulum(1.0, 1.0, 30.0, form);
      Host host(problem, tolerance);
      long values = 0, jacobians = 0;
      tp::Constraints set = problem.recommended_constraints();
      const auto g = set.value;
      const auto C = std::get<tp::DenseJacobian>(set.jacobian).fill;
      set.value = [&, g](double t, tp::ConstVector y, tp::Vector out) {
        ++values;
        return g(t, y, out);
      };
      set.jacobian = tp::DenseJacobian([&, C](double t, tp::ConstVector y, tp::Matrix out) {
        ++jacobians;
        return C(t, y, out);
      });
      host.attach(set);
      using Clock = std::chrono::steady_clock;
      const auto begin = Clock::now();
      REQUIRE(host.finish() >= 0);
      const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
      const tp::Statistics s = host.projection().statistics();
      CHECK(s.solver_calls == s.projections + s.skipped + s.corrector_failures);
      CHECK(s.solver_calls >= host.steps());
      CHECK(s.projections >= host.steps() - s.skipped);
      CHECK(s.value_evaluations == values);
      CHECK(s.jacobian_evaluations == jacobians);
      CHECK(s.value_evaluations >= s.projections);
      const long factored = s.factorizations + s.refactorizations;
      CHECK(factored >= s.projections);
      CHECK(factored <= s.jacobian_evaluations);
      CHECK(s.iterations >= s.projections);
      CHECK(s.failures() == 0);
      CHECK(s.extra_iterations <= (s.projections + s.corrections_repeated));
      CHECK(s.refreshes <= (s.projections + s.corrections_repeated));
      CHECK((s.refreshes > 0) == (std::string(form) == "index 1"));
      CHECK(s.largest_drift_before > 0.0);
      CHECK(s.largest_drift_after <= s.largest_drift_before);
      CHECK(s.mean_move > 0.0);
      CHECK(s.mean_move <= s.largest_move);
      CHECK(s.seconds > 0.0);
      CHECK(s.seconds < 20.0 * elapsed);  // it is extrapolated from a sample

      // F called by the plugin is part of IDA's own count.
      long residuals = 0;
      IDAGetNumResEvals(host.ida, &residuals);
      CHECK(s.residual_evaluations > 0);
      CHECK(s.residual_evaluations < residuals);
    }
}

TEST_CASE("rows that IDA keeps by itself are looked at, without C in most steps") {
  // Chemistry: mass is a linear combination of rates, or an equation of F.
  Host untouched(robertson(40.0, "index 0"), 1e-6);
  untouched.attach(untouched.problem.recommended_constraints());
  REQUIRE(untouched.finish() >= 0);
  const tp::Statistics looks = untouched.projection().statistics();
  CHECK(looks.projections == 0);
  CHECK(looks.skipped >= untouched.steps());
  CHECK(looks.jacobian_evaluations < looks.skipped / 8);
  CHECK(looks.seconds == 0.0);  // no clock is read

  Host begun(robertson(40.0, "index 1"), 1e-6);
  begun.attach(begun.problem.recommended_constraints());
  REQUIRE(begun.finish() >= 0);
  const tp::Statistics moves = begun.projection().statistics();
  CHECK(moves.projections > 0);
  CHECK(moves.projections + moves.skipped >= begun.steps());
  CHECK(moves.jacobian_evaluations < moves.skipped / 3);
}

TEST_CASE("rows that are the equations of F: that nothing joins them takes few evaluations") {
  Host host(akzo_nobel(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  while (host.projection().statistics().projections == 0) REQUIRE(host.step() >= 0);
  // 16 for the algebraic variables, 12 for the index, 4 and 3 for the row, a polish.
  CHECK(host.projection().statistics().residual_evaluations <= 36);
}

TEST_CASE("reset") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 1");
  Host host(problem, 1e-6);
  host.attach(problem.recommended_constraints());
  REQUIRE(host.to(5.0) >= 0);
  const long calls = host.projection().statistics().solver_calls;
  host.projection().reset_statistics();
  const tp::Statistics zero = host.projection().statistics();
  CHECK(zero.solver_calls == 0);
  CHECK(zero.mean_move == 0.0);
  CHECK(zero.largest_move == 0.0);
  CHECK(zero.seconds == 0.0);
  REQUIRE(host.to(10.0) >= 0);
  CHECK(host.projection().statistics().solver_calls > 0);
  CHECK(host.projection().statistics().solver_calls + calls >= host.steps());
}

TEST_CASE("numbers are found by the names that the table has") {
  tp::Statistics s;
  s.solver_calls = 1234567;
  s.rank_drops = 3;
  s.largest_move = 0.125;
  s.mean_move = 2.5e-7;
  s.seconds = 1.5e-3;
  CHECK(split(tp::Statistics::names()).size() >= 24);
  CHECK(s.number("solver_calls") == 1234567);
  CHECK(s.number("rank_drops") == 3);
  CHECK(s.number("largest_move") == 0.125);
  CHECK(s.number("mean_move") == 2.5e-7);
  CHECK(s.number("seconds") == 1.5e-3);
  CHECK(s.number("moves_capped") == 0.0);
  CHECK(std::isnan(s.number("none")));
  CHECK(contains(s.table(), "mean_move                = 2.500000e-07"));

  std::ostringstream streamed;
  streamed << s;
  CHECK(streamed.str() == s.table());
  CHECK(contains(s.table(), "1234567"));
}

TEST_CASE("the table begins with a verdict and leaves out what is zero") {
  tp::Statistics s;
  CHECK(contains(s.table(), "not called the plugin"));
  CHECK(s.table().find('\n') == s.table().size() - 1);
  s.solver_calls = 10;
  CHECK(contains(s.table(), "No step needed a projection"));
  s.projections = 9;
  s.largest_drift_after = 2e-13;
  s.mean_move = 0.25;
  CHECK(
      contains(s.table(), "The constraints hold: |g| is at most 2e-13, steps were moved by 0.25 "));
  CHECK_FALSE(contains(s.table(), "repeated: "));
  std::istringstream lines(s.table());
  std::string line;
  std::getline(lines, line);
  std::size_t count = 0;
  for (; std::getline(lines, line); ++count) CHECK(contains(line, " = "));
  CHECK(count == 4);
  s.untested = 3;
  CHECK(contains(s.table(), "error test are 3 algebraic variables, whose values between steps"));
  s.not_finite = 2;
  CHECK(contains(s.table(), "failed and were repeated: 2."));
  s.mean_move = 3;
  CHECK(contains(s.table(), "may not belong together: steps were moved by 3 "));
  s.steps_without_plugin = 1;
  CHECK(contains(s.table(), "another nonlinear solver was attached"));
}
