// Tether: step sizes by Soederlind's filter. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/andrews.hpp>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

const tp::Options smooth = enabled(&tp::Options::step_smoothing);

/// Rms distance of y from its straight line over x.
double scatter(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0.0, mean_y = 0.0, xx = 0.0, xy = 0.0, square = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += y[i] / n;
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double off = y[i] - mean_y - xy / xx * (x[i] - mean_x);
    square += off * off / n;
  }
  return std::sqrt(square);
}

struct Scatter {
  double error = 0.0, steps = 0.0;
  long total_steps = 0;
};

/// The scatter of log10 error and log10 steps over 25 tolerances from 1e-4 to 1e-8.
Scatter scatter_of(const Problem& problem, bool projected, const tp::Options& options) {
  std::vector<double> tolerance, error, steps;
  Scatter result;
  for (int i = 0; i < 25; ++i) {
    const double tol = std::pow(10.0, -4.0 - 4.0 * i / 24.0);
    const tp::Constraints rows = projected ? problem.recommended_constraints() : tp::Constraints{};
    const Run run = integrate(problem, tol, rows, options, false);
    REQUIRE(run.flag >= 0);
    tolerance.push_back(std::log10(tol));
    error.push_back(std::log10(run.error));
    steps.push_back(std::log10(static_cast<double>(run.steps)));
    result.total_steps += run.steps;
  }
  result.error = scatter(tolerance, error);
  result.steps = scatter(tolerance, steps);
  return result;
}

}  // namespace

TEST_CASE("smooth steps: errors follow the tolerance without scatter") {
  for (const Problem& problem :
       {pendulum(1, 1, 100, "index 1"), pendulum(1, 1, 100, "index 0"), andrews("index 1")}) {
    INFO(problem.name << ", " << problem.form);
    const Scatter plain = scatter_of(problem, false, {});
    const Scatter by_ida = scatter_of(problem, true, {});
    const Scatter filtered = scatter_of(problem, true, smooth);
    CHECK(filtered.error <= 0.07);
    CHECK(filtered.error <= 0.3 * plain.error);
    CHECK(filtered.error <= 0.35 * by_ida.error);
    CHECK(filtered.steps <= 0.02);
    CHECK(filtered.total_steps <= 1.05 * static_cast<double>(by_ida.total_steps));
  }
}

TEST_CASE("smooth steps: at the largest order every ratio is small, and the order is not frozen") {
  const Problem problem = pendulum(1, 1, 100, "index 1");
  Host host(problem, 1e-7);
  host.attach(problem.recommended_constraints(), smooth);
  double previous = 0.0, largest = 0.0;
  long at_five = 0, count = 0, changed = 0;
  while (host.t < problem.t_end) {
    REQUIRE(host.step() >= 0);
    double h = 0.0;
    int order = 0;
    IDAGetLastStep(host.ida, &h);
    IDAGetLastOrder(host.ida, &order);
    if (order == 5 && previous > 0.0 && host.t > 0.5) {  // the start is far from its step size
      largest = std::max(largest, std::abs(std::log(h / previous)));
      changed += h != previous ? 1 : 0;
      ++at_five;
    }
    previous = order == 5 ? h : 0.0;
    ++count;
  }
  CHECK(at_five > 8 * count / 10);
  CHECK(changed > 9 * at_five / 10);
  CHECK(largest <= std::log(1.35));
}

TEST_CASE("smooth steps: the longest step is kept") {
  const Problem problem = pendulum(1, 1, 20, "index 1");
  Host host(problem, 1e-4);
  tp::Options options = smooth;
  options.advanced.maximum_step = 0.01;
  host.attach(problem.recommended_constraints(), options);
  double longest = 0.0;
  while (host.t < problem.t_end) {
    REQUIRE(host.step() >= 0);
    double h = 0.0;
    IDAGetLastStep(host.ida, &h);
    longest = std::max(longest, h);
  }
  CHECK(longest <= 0.01 * (1.0 + 1e-12));
  CHECK(longest >= 0.0099);
}

TEST_CASE("smooth steps: a second run after IDAReInit has the bits of the first") {
  const Problem problem = pendulum(1, 1, 20, "index 1");
  Host host(problem, 1e-6);
  host.attach(problem.recommended_constraints(), smooth);
  REQUIRE(host.finish() >= 0);
  const std::vector<double> first = host.state();
  REQUIRE(host.restart() == 0);
  REQUIRE(host.finish() >= 0);
  CHECK(same_bits(host.state(), first));
}

TEST_CASE("smooth steps: without constraints the filter still works") {
  const Problem problem = circle(50.0);
  Host host(problem, 1e-6), plain(problem, 1e-6);
  host.attach({}, smooth);
  REQUIRE(host.finish() >= 0);
  REQUIRE(plain.finish() >= 0);
  CHECK(std::abs(std::hypot(host.data()[0], host.data()[1]) - 1.0) <= 1e-3);
  CHECK(host.steps() <= plain.steps());
  CHECK_FALSE(same_bits(host.state(), plain.state()));
}

namespace {

/// GGL pendulum beside z' = zs' - 5 (z - zs), zs = (1 - cos 5 t)^2, z >= 0: an inequality of IDA,
/// which refuses attempts that the plugin has finished. `look` is called in each residual.
Problem beside_an_inequality(std::function<void()> look) {
  Problem p = pendulum(1.0, 1.0, 20.0, "GGL");
  const int n = p.size++;
  p.jacobian = nullptr;
  p.reference.clear();
  p.atol_scale.clear();
  for (auto* values : {&p.y0, &p.yp0, &p.id}) values->push_back(values == &p.id ? 1.0 : 0.0);
  p.residual = [residual = p.residual, n, look = std::move(look)](double t, const double* y,
                                                                  const double* yp, double* r) {
    look();
    residual(t, y, yp, r);
    const double c = 1.0 - std::cos(5.0 * t);
    r[n] = yp[n] - 10.0 * c * std::sin(5.0 * t) + 5.0 * (y[n] - c * c);
  };
  return p;
}

}  // namespace

TEST_CASE("another attempt at a step has IDA's own error weights, whatever the last one did") {
  constexpr double kTolerance = 1e-6;
  const Host* watched = nullptr;
  std::vector<double> last;
  double largest = 0.0;
  const auto look = [&] {
    if (watched == nullptr) return;
    N_Vector weights = N_VClone(watched->y);
    IDAGetErrWeights(watched->ida, weights);
    for (std::size_t i = 0; i + 1 < last.size(); ++i) {
      const double own = 1.0 / (kTolerance * (std::abs(last[i]) + 1.0));
      largest = std::max(largest, std::abs(N_VGetArrayPointer(weights)[i] / own - 1.0));
    }
    N_VDestroy(weights);
  };
  const Problem problem = beside_an_inequality(look);
  const int n = problem.size - 1;
  const tp::Constraints rows = pendulum(1.0, 1.0, 20.0, "GGL").select({"position", "velocity"});
  tp::Constraints set;
  set.count = rows.total_count();
  set.value = [rows, n](double t, tp::ConstVector y, tp::Vector g) {
    g = value(rows, t, y.data(), n);
  };
  set.jacobian = tp::DenseJacobian([rows, n](double t, tp::ConstVector y, tp::Matrix C) {
    C.setZero();
    C.leftCols(n) = jacobian(rows, t, y.data(), n);
  });
  Host host(problem, kTolerance);
  host.attach(set);
  std::vector<double> signs(static_cast<std::size_t>(problem.size), 0.0);
  signs.back() = 1.0;
  REQUIRE(IDASetConstraints(host.ida, host.vector(signs)) == 0);
  last = host.state();
  watched = &host;
  while (host.t < problem.t_end) {
    REQUIRE(host.step() >= 0);
    last = host.state();
  }
  long failures = 0;
  IDAGetNumErrTestFails(host.ida, &failures);
  CHECK(host.projection().statistics().smoothing_begun == 1);
  CHECK(host.projection().statistics().solver_calls > host.steps() + failures + 5);
  CHECK(largest <= 1e-9);
}
