// Tether: smooth step sizes that begin by themselves. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/andrews.hpp>
#include <problems/governor.hpp>
#include <problems/pendulum.hpp>
#include <problems/transistor_amplifier.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

const tp::Options smooth = enabled(&tp::Options::step_smoothing);

}  // namespace

// Every variable of the amplifier is differential, sums of their equations are not: the error test
// cannot be told. Plain IDA takes 3 000 to 60 000 steps and more; smooth steps 1 500 to 10 000.
TEST_CASE("smooth steps begin where hidden algebraic combinations make IDA refuse") {
  const Problem problem = transistor_amplifier();
  for (int i = 0; i <= 10; ++i) {
    const double tolerance = std::pow(10.0, -4.0 - 0.5 * i);
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.smoothing_begun == 1);
    CHECK(run.error <= 40.0 * tolerance);
    CHECK(static_cast<double>(run.steps) <= 1900.0 * std::pow(tolerance / 1e-4, -0.15));
  }
}

namespace {

/// The amplifier with unknowns that rest, `size` in all.
Problem padded_amplifier(int size) {
  const Problem small = transistor_amplifier();
  const auto n = static_cast<std::size_t>(size);
  Problem problem = ode(std::vector<double>(n, 0.0), 0.04,
                        [n](double, const double*, double* f) { std::fill(f, f + n, 0.0); });
  std::copy(small.y0.begin(), small.y0.end(), problem.y0.begin());
  std::copy(small.yp0.begin(), small.yp0.end(), problem.yp0.begin());
  problem.residual = [small, size](double t, const double* y, const double* yp, double* r) {
    small.residual(t, y, yp, r);
    std::copy(yp + small.size, yp + size, r + small.size);
  };
  return problem;
}

tp::Constraints padded_rows() {
  const Problem small = transistor_amplifier();
  const tp::Constraints rows = small.recommended_constraints();
  tp::Constraints set;
  set.count = rows.total_count();
  set.value = [rows, n = small.size](double t, tp::ConstVector y, tp::Vector g) {
    g = value(rows, t, y.data(), n);
  };
  set.jacobian =
      tp::DenseJacobian([rows, n = small.size](double t, tp::ConstVector y, tp::Matrix C) {
        C.setZero();
        C.leftCols(n) = jacobian(rows, t, y.data(), n);
      });
  return set;
}

}  // namespace

TEST_CASE("smooth steps begin after ten refused ones in a row, where the index is not looked at") {
  // Above 200 unknowns it is not, where IDA's Jacobian takes no evaluations of F.
  Problem problem = padded_amplifier(201);
  problem.jacobian = [F = problem.residual, n = problem.size](double t, double cj, const double* y,
                                                              const double* yp, double* J) {
    const auto size = static_cast<std::size_t>(n);
    std::vector<double> at(y, y + n), rate(yp, yp + n), before(size), after(size);
    F(t, y, yp, before.data());
    for (std::size_t j = 0; j < size; ++j) {
      const double change = 1e-7 * std::max(1e-3, std::abs(y[j]));
      at[j] += change;
      rate[j] += cj * change;
      F(t, at.data(), rate.data(), after.data());
      at[j] = y[j];
      rate[j] = yp[j];
      for (std::size_t i = 0; i < size; ++i) J[j * size + i] = (after[i] - before[i]) / change;
    }
  };
  // Rounding decides whether a run gets there: two of these eight do.
  int begun = 0;
  for (int k = 0; k < 8; ++k) {
    Host host(problem, 1e-8 * std::pow(2.0, k / 8.0));
    host.attach(padded_rows());
    long refused = 0, in_row = 0;
    while (host.t < problem.t_end && host.projection().statistics().smoothing_begun == 0) {
      REQUIRE(host.step() >= 0);
      REQUIRE(host.steps() < 5000);
      long failures = 0;
      IDAGetNumErrTestFails(host.ida, &failures);
      in_row = failures > refused ? in_row + 1 : 0;
      refused = failures;
      REQUIRE(in_row <= 11);
    }
    begun += host.projection().statistics().smoothing_begun == 1 ? 1 : 0;
    CHECK(host.steps() > 100);
  }
  CHECK(begun >= 1);
}

TEST_CASE("smooth steps begin where every third step is refused at order 1 for ever") {
  // The response of stiff dampers to moves is as long as the error that order 1 allows.
  const Problem problem = governor(1.0, "index 0");
  for (const double tolerance : {7e-6, 6.5e-6}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.smoothing_begun == 1);
    CHECK(run.steps <= 400);  // 4000 without
    CHECK(run.error <= 10.0 * tolerance);
  }
}

TEST_CASE("smooth steps begin at once at any size whose Jacobians cost as much as the look") {
  for (const double tolerance : {1e-7}) {
    long few = 0;
    for (const int size : {200, 201, 240}) {
      INFO("tolerance " << tolerance << ", " << size << " unknowns");
      Host host(padded_amplifier(size), tolerance);
      host.attach(padded_rows());
      while (host.t < host.problem.t_end && host.steps() < 2000) REQUIRE(host.step() >= 0);
      CHECK(host.t >= host.problem.t_end);
      CHECK(host.projection().statistics().smoothing_begun == 1);
      CHECK(host.projection().statistics().residual_evaluations <= 2 * size + 3 * host.steps());
      if (size == 200) few = host.steps();
      CHECK(host.steps() <= few + few / 10);
    }
  }
}

namespace {

/// A pendulum beside 300 unknowns that rest, and one, w = x^2, that F determines.
Problem pendulum_among_many(const std::string& form) {
  const Problem small = pendulum(1.0, 1.0, 20.0, form);
  Problem p = small;
  const int w = small.size;
  p.size += 301;
  for (auto* values : {&p.y0, &p.yp0, &p.id})
    values->resize(static_cast<std::size_t>(p.size), values == &p.id ? 1.0 : 0.0);
  p.id[static_cast<std::size_t>(w)] = 0.0;
  p.y0[static_cast<std::size_t>(w)] = p.y0[0] * p.y0[0];
  if (!p.atol_scale.empty()) p.atol_scale.resize(p.y0.size(), 1.0);
  p.residual = [small, w, n = p.size](double t, const double* y, const double* yp, double* r) {
    small.residual(t, y, yp, r);
    r[w] = y[w] - y[0] * y[0];
    std::copy(yp + w + 1, yp + n, r + w + 1);
  };
  p.jacobian = [small, w, n = p.size](double t, double cj, const double* y, const double* yp,
                                      double* J) {
    std::vector<double> inner(static_cast<std::size_t>(w) * static_cast<std::size_t>(w), 0.0);
    small.jacobian(t, cj, y, yp, inner.data());
    for (int j = 0; j < w; ++j) std::copy_n(inner.data() + j * w, w, J + j * n);
    J[w] = -2.0 * y[0];
    J[w * n + w] = 1.0;
    for (int j = w + 1; j < n; ++j) J[j * n + j] = cj;
  };
  return p;
}

tp::Constraints length_of(const Problem& problem) {
  const int n = problem.size;
  return row(
      "length", [](double, const double* y) { return (y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0; },
      [n](double, const double* y, double* c) {
        std::fill(c, c + n, 0.0);
        c[0] = y[0];
        c[1] = y[1];
      });
}

}  // namespace

TEST_CASE("multipliers of velocity rows are seen among many unknowns, by eight evaluations of F") {
  for (const char* form : {"index 1", "index 2", "GGL"}) {
    INFO(form);
    Host host(pendulum_among_many(form), 1e-6);
    REQUIRE(host.problem.jacobian);
    tp::Options options;
    options.id = host.vector(host.problem.id);
    host.attach(length_of(host.problem), options);
    REQUIRE(host.finish() >= 0);
    const tp::Statistics statistics = host.projection().statistics();
    CHECK(statistics.smoothing_begun == (std::string(form) == "index 1" ? 0 : 1));
    CHECK(statistics.residual_evaluations <= 40 + 3 * host.steps());
  }
}

TEST_CASE("smooth steps begin in forms of index 2 and make them as accurate as those of index 1") {
  tp::Options ida_alone;
  ida_alone.advanced.smooth_where_needed = false;
  for (const char* form : {"GGL", "index 2"}) {
    double better = 0.0;
    for (int i = 0; i <= 6; ++i) {
      const double tolerance = std::pow(10.0, -4.0 - 4.0 * i / 6.0);
      INFO(form << ", tolerance " << tolerance);
      const Problem problem = pendulum(1, 1, 100, form);
      const tp::Constraints rows = problem.recommended_constraints();
      const Run run = integrate(problem, tolerance, rows, {}, false);
      const Run plain = integrate(problem, tolerance, rows, ida_alone, false);
      REQUIRE(run.flag >= 0);
      CHECK(run.statistics.smoothing_begun == 1);
      CHECK(plain.statistics.smoothing_begun == 0);
      CHECK(run.error <= 500.0 * tolerance);
      CHECK(run.steps <= plain.steps);
      better += std::log10(plain.error / run.error) / 7.0;
    }
    CHECK(better >= 0.7);
  }
}

TEST_CASE("smooth steps that begin by themselves are as accurate as those from the start") {
  for (const Problem& problem :
       {pendulum(1, 1, 100, "GGL"), pendulum(1, 1, 100, "index 2"), andrews("GGL")}) {
    INFO(problem.name << ", " << problem.form);
    const tp::Constraints rows = problem.recommended_constraints();
    double worse = 0.0, slope = 0.0, wanted = 0.0;  // slopes of log error over log tolerance
    for (int i = 0; i <= 6; ++i) {
      const double tolerance = std::pow(10.0, -4.0 - 6.0 * i / 6.0);
      const Run begun = integrate(problem, tolerance, rows, {}, false);
      const Run from_start = integrate(problem, tolerance, rows, smooth, false);
      REQUIRE(begun.flag >= 0);
      REQUIRE(from_start.flag >= 0);
      CHECK(static_cast<double>(begun.steps) <= 1.1 * static_cast<double>(from_start.steps));
      worse += std::log(begun.error / from_start.error) / 7.0;
      if (i == 0 || i == 6) {
        slope += (i == 0 ? 1.0 : -1.0) * std::log10(begun.error) / 6.0;
        wanted += (i == 0 ? 1.0 : -1.0) * std::log10(from_start.error) / 6.0;
      }
    }
    CHECK(std::exp(worse) <= 1.5);
    CHECK(slope >= wanted - 0.1);
  }
}

TEST_CASE("smooth steps do not begin by themselves where IDA gets on") {
  for (const Problem& problem :
       {pendulum(1, 1, 100, "index 1"), pendulum(1, 1, 100, "index 0"), andrews("index 1")}) {
    INFO(problem.name << ", " << problem.form);
    const Run run = integrate(problem, 1e-6, problem.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.smoothing_begun == 0);
  }
}

TEST_CASE(
    "smooth steps that began by refusals keep the host's longest step, and a restart undoes them") {
  const Problem problem = transistor_amplifier();
  Host host(problem, 1e-6);
  const double longest_allowed = 2e-5;
  REQUIRE(IDASetMaxStep(host.ida, longest_allowed) == 0);
  host.attach(problem.recommended_constraints());
  double longest = 0.0;
  const auto run = [&] {
    while (host.t < 0.05) {
      REQUIRE(host.step() >= 0);
      double h = 0.0;
      IDAGetLastStep(host.ida, &h);
      longest = std::max(longest, h);
    }
  };
  run();
  CHECK(longest <= longest_allowed * (1.0 + 1e-12));
  CHECK(longest >= 0.9 * longest_allowed);
  REQUIRE(host.projection().statistics().smoothing_begun == 1);
  const std::vector<double> first = host.state();
  REQUIRE(host.restart() == 0);
  run();
  CHECK(same_bits(host.state(), first));
}
