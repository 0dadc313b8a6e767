// Tether: one motion in several forms, against plain IDA's best form. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <problems/car_axis.hpp>
#include <problems/kepler.hpp>
#include <problems/link_chain.hpp>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "motions.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

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
      CHECK(run.error <= 200.0 * tolerance);
      CHECK(run.drift <= 1e-9);
    }
  }
}

TEST_CASE("points on a sphere in forms of index 2: never worse than plain IDA by a factor of two") {
  const Problem reduced = points_on_sphere(20, "index 0", 3.0);
  for (const char* form : {"GGL", "index 2"}) {
    const Problem problem = with_reference(points_on_sphere(20, form, 3.0), reduced, {"sphere"});
    // Which of two runs of nearly the same number of steps is the shorter one is up to rounding.
    const std::vector<double> tolerances = {1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7, 3e-8};
    double error = 0.0, steps = 0.0;  // logarithms of the means
    for (const double tolerance : tolerances) {
      INFO(form << ", tolerance " << tolerance);
      const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
      const Run plain = integrate_suppressed(problem, tolerance);
      REQUIRE(run.flag >= 0);
      CHECK(run.error <= 2.0 * plain.error);
      const double ratio = static_cast<double>(run.steps) / static_cast<double>(plain.steps);
      CHECK(ratio <= 1.1);
      const auto share = 1.0 / static_cast<double>(tolerances.size());
      error += share * std::log(run.error / plain.error);
      steps += share * std::log(ratio);
    }
    INFO(form);
    CHECK(std::exp(error) <= 0.7);
    CHECK(std::exp(steps) <= 0.96);
  }
}

TEST_CASE("car axis in GGL form: as accurate as plain IDA's best, in three quarters of its steps") {
  const Problem problem = car_axis("GGL");
  for (const double tolerance : {1e-5, 1e-7}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
    const Run plain = integrate_suppressed(problem, tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(run.error <= 2.0 * plain.error);
    CHECK(4 * run.steps <= 3 * plain.steps);
  }
}

namespace {

// At 30 times that share the run evenly: errors at one time pass through zeros.
std::vector<std::vector<double>> differential_states(Host& host, int count) {
  std::vector<std::vector<double>> states;
  for (int i = 1; i <= 30; ++i) {
    if (host.to(host.problem.t_end * i / 30.0) < 0) break;
    states.emplace_back(host.data(), host.data() + count);
  }
  return states;
}

double furthest(const std::vector<std::vector<double>>& a,
                const std::vector<std::vector<double>>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < a[i].size(); ++j)
      largest = std::max(largest, std::abs(a[i][j] - b[i][j]) / (1.0 + std::abs(b[i][j])));
  return largest;
}

}  // namespace

TEST_CASE("car axis over 30 times: no tighter tolerance leaves plain IDA's error behind") {
  constexpr int kMotion = 8;  // positions and velocities
  Host exact(car_axis("index 0"), 1e-12);
  exact.attach(exact.problem.recommended_constraints());
  const auto reference = differential_states(exact, kMotion);
  for (const char* form : {"GGL", "index 2"}) {
    double mean = 0.0, mean_steps = 0.0;
    for (const double tolerance : {1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 3e-9, 1e-9}) {
      INFO(form << ", tolerance " << tolerance);
      Host projected(car_axis(form), tolerance), plain(car_axis(form), tolerance);
      projected.attach(projected.problem.recommended_constraints());
      IDASetId(plain.ida, plain.vector(plain.problem.id));
      IDASetSuppressAlg(plain.ida, 1);
      const double error = furthest(differential_states(projected, kMotion), reference);
      const double plain_error = furthest(differential_states(plain, kMotion), reference);
      CHECK(error <= 3.5 * plain_error);
      mean += std::log(error / plain_error) / 7.0;
      const double steps =
          static_cast<double>(projected.steps()) / static_cast<double>(plain.steps());
      CHECK(steps <= 1.05);
      mean_steps += std::log(steps) / 7.0;
    }
    CHECK(std::exp(mean) <= 1.5);
    CHECK(std::exp(mean_steps) <= 0.9);
  }
}

namespace {

struct Mean {
  double steps = 0.0;
  int runs = 0;
};

/// Dense and sparse rows against the better of plain IDA and plain IDA with algebraic variables out
/// of the error test, which may fail where the projection must not.
void compare(const Problem& problem, double tolerance, Mean* mean) {
  INFO(problem.name << ", " << problem.form << ", tolerance " << tolerance);
  const tp::Constraints rows = problem.select(problem.recommended);  // dense ones
  const Run dense = integrate(problem, tolerance, rows, {}, false);
  const Run sparse = integrate(
      problem, tolerance,
      problem.sparse_constraints ? *problem.sparse_constraints : as_sparse(rows, problem.size), {},
      false);
  REQUIRE(dense.flag >= 0);
  REQUIRE(sparse.flag >= 0);
  CHECK(same_bits(dense.y, sparse.y));
  Run plain = integrate_suppressed(problem, tolerance);
  if (problem.index == 1) {
    const Run tested = integrate_plain(problem, tolerance);
    if (tested.flag >= 0) plain.error = std::min(plain.error, tested.error);
  }
  CHECK(dense.error <= 2.0 * plain.error);
  CHECK(sparse.error <= 2.0 * plain.error);
  if (!std::isfinite(plain.error)) return;
  for (const long steps : {dense.steps, sparse.steps}) {
    const double ratio = static_cast<double>(steps) / static_cast<double>(plain.steps);
    CHECK(ratio <= 1.4);
    mean->steps += std::log(ratio);
    ++mean->runs;
  }
}

}  // namespace

TEST_CASE(
    "every form, dense and sparse rows: no failure, no more steps than plain IDA's best form") {
  Mean mean;
  std::vector<Problem> problems = {kepler(0.9, 12.0)};
  problems[0].recommended = {"energy", "momentum", "eccentricity"};  // four rows of rank 3
  for (const char* form : {"index 0", "index 1", "index 1 w", "index 2", "GGL"})
    problems.push_back(pendulum(1, 1, 20, form));
  const Problem reduced = spherical_pendulum("index 0", 20.0);
  for (const char* form : {"index 0", "index 1", "index 2", "GGL"})
    problems.push_back(
        with_reference(spherical_pendulum(form, 20.0), reduced, reduced.recommended));
  for (const Problem& problem : problems)
    for (const double tolerance : {1e-3, 2e-5, 3e-7, 4e-9}) compare(problem, tolerance, &mean);
  CHECK(std::exp(mean.steps / mean.runs) <= 1.0);
}

TEST_CASE("vortices, a top, the figure eight, points on a sphere: the same") {
  Mean mean;
  std::vector<Problem> problems;
  for (const Problem& problem : {vortices(20.0), lagrange_top(10.0), figure_eight(8.0)}) {
    for (const double g :
         value(problem.recommended_constraints(), 0.0, problem.y0.data(), problem.size))
      CHECK(std::abs(g) < 1e-14);
    CHECK(tp::check_jacobian(problem.recommended_constraints(), 0.0, problem.y0, 1e-6).correct);
    problems.push_back(with_reference(problem, problem, problem.recommended));
  }
  const Problem reduced = points_on_sphere(12, "index 0", 3.0);
  for (const char* form : {"index 0", "index 1"})
    problems.push_back(with_reference(points_on_sphere(12, form, 3.0), reduced, {"sphere"}));
  for (const Problem& problem : problems)
    for (const double tolerance : {1e-3, 1e-5, 1e-7, 1e-9}) compare(problem, tolerance, &mean);
  CHECK(std::exp(mean.steps / mean.runs) <= 1.1);
}

TEST_CASE("chain of 20 links, dense rows and sparse ones of few entries: the same") {
  Mean mean;
  const Problem problem = link_chain(20, 0.3);
  for (const double tolerance : {1e-3, 1e-5, 1e-7}) compare(problem, tolerance, &mean);
  CHECK(std::exp(mean.steps / mean.runs) <= 1.0);
}
