// Tether: where there is nothing to enforce, IDA's results stay bit for bit.
// SPDX-License-Identifier: BSD-3-Clause
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>
#include <problems/robertson.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

tp::Constraints nothing() {
  tp::Constraints set;
  set.count = 2;
  set.names = {"zero", "zero too"};
  set.value = [](double, tp::ConstVector, tp::Vector g) { g.setZero(); };
  set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    C.row(0) = y.transpose();
    C.row(1).setOnes();
  });
  return set;
}

/// Steps both in lockstep; every step, order and bit must agree.
void compare(const Problem& problem, double tolerance, const tp::Constraints& rows,
             const tp::Options& options = {}) {
  INFO(problem.name << ", " << problem.form << ", tolerance " << tolerance);
  Host plain(problem, tolerance), projected(problem, tolerance);
  projected.attach(rows, options);
  bool same = true;
  while (plain.t < problem.t_end && same) {
    REQUIRE(plain.step() >= 0);
    REQUIRE(projected.step() >= 0);
    int a = 0, b = 0;
    IDAGetLastOrder(plain.ida, &a);
    IDAGetLastOrder(projected.ida, &b);
    same = plain.t == projected.t && a == b && same_bits(plain.state(), projected.state());
  }
  INFO("t = " << plain.t << ", step " << plain.steps());
  CHECK(same);
  CHECK(plain.steps() == projected.steps());
  long iterations[2], failures[2], residuals[2];
  IDAGetNumNonlinSolvIters(plain.ida, &iterations[0]);
  IDAGetNumNonlinSolvIters(projected.ida, &iterations[1]);
  IDAGetNumErrTestFails(plain.ida, &failures[0]);
  IDAGetNumErrTestFails(projected.ida, &failures[1]);
  IDAGetNumResEvals(plain.ida, &residuals[0]);
  IDAGetNumResEvals(projected.ida, &residuals[1]);
  CHECK(iterations[0] == iterations[1]);
  CHECK(failures[0] == failures[1]);
  CHECK(residuals[0] == residuals[1]);
  // The plugin was in use, and moved nothing.
  const tp::Statistics s = projected.projection().statistics();
  CHECK(s.solver_calls >= projected.steps());
  CHECK(s.projections == 0);
  if (rows.total_count() > 0) CHECK(s.skipped >= projected.steps());
}

}  // namespace

TEST_CASE("no constraints") {
  for (const double tolerance : {1e-4, 1e-8}) {
    compare(pendulum(1.0, 1.0, 20.0, "index 1"), tolerance, {});
    compare(pendulum(1.1, 9.80665, 5.0, "index 0"), tolerance, {});
    compare(robertson(4e5), tolerance, {});
    compare(car_axis("index 1 w"), tolerance, {});
    compare(andrews("index 1"), tolerance, {});
  }
}

TEST_CASE("g identically zero, with a gradient that is not") {
  for (const double tolerance : {1e-4, 1e-8}) {
    compare(pendulum(1.0, 1.0, 20.0, "index 1"), tolerance, nothing());
    compare(robertson(4e5), tolerance, nothing());
  }
  tp::Options options;
  options.advanced.metric = tp::Metric::error_weights;
  compare(pendulum(1.0, 1.0, 20.0, "index 0"), 1e-6, nothing(), options);
}

TEST_CASE("a linear invariant that BDF keeps by itself") {
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    // Index 0: nothing but BDF's own linearity keeps the mass. (In index 1 IDA solves for it, but
    // only to its Newton tolerance.)
    const Problem problem = robertson(40.0, "index 0");
    compare(problem, tolerance, problem.recommended_constraints());
    const Problem decay = ode({1.0, 0.0, 0.5}, 10.0, [](double t, const double* y, double* f) {
      f[0] = -y[0] * (1.0 + 0.5 * std::sin(3.0 * t));
      f[1] = -2.0 * f[0];
      f[2] = 0.0;
    });
    compare(decay, tolerance, tp::linear_invariant({2.0, 1.0, 0.0}, 2.0));
  }
}

TEST_CASE("a look at rows that are kept costs g, and C now and then") {
  const Problem problem = robertson(40.0, "index 0");
  for (const double tolerance : {1e-4, 1e-6, 3e-8}) {
    INFO("tolerance " << tolerance);
    Host host(problem, tolerance);
    host.attach(problem.recommended_constraints());
    REQUIRE(host.finish() >= 0);
    const tp::Statistics s = host.projection().statistics();
    CHECK(s.skipped >= host.steps());
    CHECK(s.value_evaluations <= s.skipped + 10);
    CHECK(10 * s.jacobian_evaluations <= s.skipped);
    CHECK(10 * s.factorizations <= s.skipped);
    CHECK(s.iterations == 0);
  }
}

TEST_CASE("rows that are kept up to some time are moved onto as soon as they are not") {
  // A mass that rounds, and a rotation that begins smoothly at t = 2.
  const Problem late = ode({1.0, 0.0, 0.7, 0.3}, 10.0, [](double t, const double* y, double* f) {
    const double speed = t > 2.0 ? 0.3 * (t - 2.0) * (t - 2.0) : 0.0;
    f[0] = -speed * y[1];
    f[1] = speed * y[0];
    f[2] = -y[2] * (1.0 + 0.5 * std::sin(3.0 * t));
    f[3] = -f[2];
  });
  const tp::Constraints rows =
      tp::linear_invariant({0.0, 0.0, 1.0, 1.0}, 1.0) +
      tp::invariant([](tp::ConstVector y) { return (y[0] * y[0] + y[1] * y[1]) / 2.0; },
                    [](tp::ConstVector y, tp::Vector gradient) {
                      gradient[0] = y[0];
                      gradient[1] = y[1];
                    },
                    0.5);
  for (const double tolerance : {1e-4, 1e-6, 1e-9}) {
    INFO("tolerance " << tolerance);
    Host host(late, tolerance);
    host.attach(rows);
    double drift = 0.0;
    while (host.t < late.t_end) {
      REQUIRE(host.step() >= 0);
      const auto y = host.state();
      drift = std::max(drift, std::abs((y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0));
    }
    CHECK(drift <= 1e-4 * tolerance + 1e-15);  // Options::tolerance
    CHECK(host.projection().statistics().projections > 0);
  }
}

TEST_CASE("at rest where every row has its zero: nothing moves, ever") {
  // Pendulum hanging still: the energy row is parallel to the length row, g is exactly 0.
  Problem rest = pendulum(1.0, 9.80665, 50.0, "index 1");
  rest.y0 = {0.0, -1.0, 0.0, 0.0, 9.80665};
  rest.yp0.assign(5, 0.0);
  const tp::Constraints rows =
      rest.select({"position", "velocity"}) +
      tp::energy(
          [](tp::ConstVector y) { return (y[2] * y[2] + y[3] * y[3]) / 2.0 + 9.80665 * y[1]; },
          [](tp::ConstVector y, tp::Vector gradient) {
            gradient[1] = 9.80665;
            gradient[2] = y[2];
            gradient[3] = y[3];
          },
          -9.80665);
  Host host(rest, 1e-8);
  host.attach(rows);
  REQUIRE(host.finish() >= 0);
  CHECK(same_bits(host.state(), rest.y0));
  CHECK(host.steps() < 80);
}
