// Tether: consistent starts, projected points, and solve() in every mode.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <nvector/nvector_serial.h>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

int pendulum_residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  static_cast<const Problem*>(data)->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp),
                                              N_VGetArrayPointer(r));
  return 0;
}

/// x' = y' = 0: a point that stays, for projections alone.
Problem still(std::vector<double> y0) {
  return ode(std::move(y0), 1.0,
             [n = y0.size()](double, const double*, double* f) { std::fill(f, f + n, 0.0); });
}

/// project() must refuse, name `why`, and leave the point as it was.
void refused(const std::vector<double>& point, double tolerance, const tp::Constraints& set,
             tp::Status why) {
  Problem problem = still(point);
  Host host(problem, tolerance);
  host.attach(set);
  N_Vector velocity = host.vector(std::vector<double>(point.size(), 0.25));
  const tp::ConsistencyReport report = host.projection().project(0.0, host.y, velocity);
  INFO(report.message);
  CHECK_FALSE(report);
  CHECK(report.status == why);
  CHECK_FALSE(report.message.empty());
  CHECK(report.iterations <= 60);
  CHECK(same_bits(host.state(), point));
  CHECK(N_VGetArrayPointer(velocity)[0] == 0.25);
  CHECK(host.projection().status() == why);

  const tp::ConsistencyReport start = host.projection().make_consistent(0.0, host.y, host.yp);
  CHECK_FALSE(start);
  CHECK(start.status == why);
  CHECK(same_bits(host.state(), point));
  CHECK(host.steps() == 0);  // IDA is as the caller had it, not where it was probed
}

}  // namespace

TEST_CASE("make_consistent: pendulum off its rod, both forms") {
  for (const char* form : {"index 1", "index 0"}) {
    INFO(form);
    Problem problem = pendulum(1.0, 9.81, 1.0, form);
    const tp::Constraints rows = problem.recommended_constraints();
    problem.y0[0] += 3e-3;
    problem.y0[3] += 2e-3;
    problem.y0[2] -= 1e-3;
    Host host(problem, 1e-6);
    tp::Options options;
    options.id = host.vector(problem.id);
    host.attach(rows, options);
    tp::Consistency how;
    how.residual = pendulum_residual;
    how.user_data = &host.problem;
    const tp::ConsistencyReport report =
        host.projection().make_consistent(0.0, host.y, host.yp, how);
    INFO(report.message);
    REQUIRE(report);
    CHECK(report.status == tp::Status::success);
    CHECK(value(rows, 0.0, host.data(), 5).cwiseAbs().maxCoeff() < 1e-13);
    CHECK(report.drift_before > 1e-3);
    CHECK(report.drift_after < 1e-13);
    CHECK(report.largest_change > 9e-4);
    CHECK(report.largest_change < 2e-2);
    CHECK(report.changed_component >= 0);
    CHECK(report.move > 100.0);
    CHECK(report.rank == rows.total_count());
    CHECK(report.iterations <= 6);
    CHECK(report.residual_before > 1e-4);
    CHECK(report.residual_after >= 0.0);
    CHECK(report.residual_after < 1e-6);
    // x'' = -x lam and so on hold with the new values.
    std::vector<double> r(5);
    problem.residual(0.0, host.data(), N_VGetArrayPointer(host.yp), r.data());
    for (const double x : r) CHECK(std::abs(x) < 1e-6);
    REQUIRE(host.finish() >= 0);
    CHECK(host.projection().status() == tp::Status::success);
    CHECK(host.projection().statistics().failures() == 0);
  }
}

TEST_CASE("make_consistent: the id of algebraic variables is derived") {
  Problem problem = car_axis("index 1");
  problem.y0[1] += 1e-3;
  problem.y0[8] = 0.7;  // a wrong multiplier
  Host host(problem, 1e-6);
  host.attach(problem.recommended_constraints());
  const tp::ConsistencyReport report = host.projection().make_consistent(0.0, host.y, host.yp);
  INFO(report.message);
  REQUIRE(report);
  CHECK(report.drift_after < 1e-13);
  std::vector<double> r(static_cast<std::size_t>(problem.size));
  problem.residual(0.0, host.data(), N_VGetArrayPointer(host.yp), r.data());
  for (const double x : r) CHECK(std::abs(x) < 1e-5);
  CHECK(host.finish() >= 0);
}

TEST_CASE("make_consistent: ways to y'") {
  using Derivative = tp::Consistency::Derivative;
  for (const Derivative way :
       {Derivative::automatic, Derivative::calc_ic, Derivative::least_squares, Derivative::keep}) {
    INFO("way " << static_cast<int>(way));
    Problem problem = pendulum(1.0, 9.81, 1.0, "index 1");
    problem.y0[0] += 1e-3;
    const double slope = problem.yp0[3];
    Host host(problem, 1e-6);
    host.attach(problem.recommended_constraints());
    tp::Consistency how;
    how.derivative = way;
    how.residual = pendulum_residual;
    how.user_data = &host.problem;
    const tp::ConsistencyReport report =
        host.projection().make_consistent(0.0, host.y, host.yp, how);
    INFO(report.message);
    REQUIRE(report);
    CHECK(report.drift_after < 1e-13);
    if (way == Derivative::keep) {
      CHECK(N_VGetArrayPointer(host.yp)[3] == slope);
    } else {
      CHECK(report.residual_after < 1e-6);
    }
  }
}

TEST_CASE("make_consistent: a way to y' that does not exist is refused") {
  Host host(tether::test::circle(1.0), 1e-6);
  host.attach(on_circle());
  tp::Consistency how;
  how.derivative = static_cast<tp::Consistency::Derivative>(99);
  CHECK(contains(thrown([&] { host.projection().make_consistent(0.0, host.y, host.yp, how); }),
                 "derivative = 99"));
}

TEST_CASE("make_consistent: held components stay") {
  Problem problem = still({1.1, 0.2});
  Host host(problem, 1e-6);
  host.attach(circle_of(1.0, "circle"));
  tp::Consistency how;
  how.hold = {false, true};
  const tp::ConsistencyReport report = host.projection().make_consistent(0.0, host.y, host.yp, how);
  REQUIRE(report);
  CHECK(host.data()[1] == 0.2);
  CHECK(host.data()[0] == Approx(std::sqrt(0.96)).epsilon(1e-13));
  how.hold = {true};
  CHECK(contains(thrown([&] { host.projection().make_consistent(0.0, host.y, host.yp, how); }),
                 "hold"));
}

TEST_CASE("refused: rows without a common point") {
  refused({1.1, 0.2}, 1e-6, circle_of(1.0, "unit") + circle_of(2.0, "other"),
          tp::Status::inconsistent);
  const auto plane = [](double x) {
    return row(
        "x = " + std::to_string(x), [x](double, const double* y) { return y[0] - x; },
        [](double, const double*, double* c) { c[0] = 1.0; });
  };
  refused({0.0, 1.0}, 1e-9, plane(0.0) + plane(1e-6), tp::Status::inconsistent);
  refused({0.1, 0.2}, 1e-6,
          row(
              "no point at all",
              [](double, const double* y) { return y[0] * y[0] + y[1] * y[1] + 1.0; },
              [](double, const double* y, double* c) {
                c[0] = 2.0 * y[0];
                c[1] = 2.0 * y[1];
              }),
          tp::Status::not_converged);
  // Below the tolerance the two planes are one.
  Problem problem = still({0.0, 1.0});
  Host host(problem, 1e-3);
  host.attach(plane(0.0) + plane(1e-6));
  CHECK(host.projection().make_consistent(0.0, host.y, host.yp));
}

TEST_CASE("refused: the rows are named") {
  Problem problem = still({1.1, 0.2});
  Host host(problem, 1e-6);
  host.attach(circle_of(1.0, "unit") + circle_of(2.0, "other"));
  const tp::ConsistencyReport report = host.projection().project(0.0, host.y);
  CHECK(contains(report.message, "unit"));
  CHECK(contains(report.message, "other"));
  CHECK(report.contradicting_rows == std::vector<int>{0, 1});
}

TEST_CASE("vanishing gradient: accepted with a warning, or refused, never wild") {
  for (const std::vector<double>& start : {std::vector<double>{1.1, 0.2}, {1.3, 0.0}}) {
    Problem problem = still(start);
    Host host(problem, 1e-6);
    host.attach(row(
        "squared",
        [](double, const double* y) { return std::pow(y[0] * y[0] + y[1] * y[1] - 1.0, 2); },
        [](double, const double* y, double* c) {
          const double r = 4.0 * (y[0] * y[0] + y[1] * y[1] - 1.0);
          c[0] = r * y[0];
          c[1] = r * y[1];
        }));
    const tp::ConsistencyReport report = host.projection().project(0.0, host.y);
    INFO(report.message << ", " << report.iterations << " iterations");
    CHECK(report.slow_convergence);
    CHECK_FALSE(report.message.empty());
    if (report) {
      CHECK(std::abs(std::hypot(host.data()[0], host.data()[1]) - 1.0) < 1e-6);
    } else {
      CHECK(same_bits(host.state(), start));
    }
  }
}

TEST_CASE("project: nearest point, tangent velocity, report") {
  Problem problem = still({3.0, 4.0});
  Host host(problem, 1e-6);
  host.attach(circle_of(1.0, "circle"));
  N_Vector velocity = host.vector({2.0, 1.0});
  const tp::ConsistencyReport report = host.projection().project(0.0, host.y, velocity);
  REQUIRE(report);
  CHECK(std::abs(std::hypot(host.data()[0], host.data()[1]) - 1.0) < 1e-14);
  const double* v = N_VGetArrayPointer(velocity);
  CHECK(std::abs(host.data()[0] * v[0] + host.data()[1] * v[1]) < 1e-9);
  CHECK(report.derivative_change > 0.5);
  CHECK(report.drift_before == 24.0);
  CHECK(report.rank == 1);
  CHECK(report.iterations <= 10);
  // A second time nothing moves.
  const std::vector<double> there = host.state();
  CHECK(host.projection().project(0.0, host.y).largest_change < 1e-15);
  CHECK(std::abs(host.data()[0] - there[0]) < 1e-15);
  CHECK(contains(thrown([&] { host.projection().project(0.0, nullptr); }), "yy"));
}

TEST_CASE("project: points between steps, which the steps do not notice") {
  const Problem problem = pendulum(1.0, 9.81, 3.0, "index 1");
  const auto end_of = [&problem](bool output) {
    const auto length = row(
        "length", [](double, const double* y) { return y[0] * y[0] + y[1] * y[1] - 1.0; },
        [](double, const double* y, double* c) {
          c[0] = 2.0 * y[0];
          c[1] = 2.0 * y[1];
        });
    const auto rate = row(
        "rate", [](double, const double* y) { return y[0] * y[2] + y[1] * y[3]; },
        [](double, const double* y, double* c) {
          for (int i = 0; i < 4; ++i) c[i] = y[(i + 2) % 4];
        });
    Host host(problem, 1e-6);
    tp::Projection& projection = host.attach(length + rate);
    while (host.t < 2.0) {
      REQUIRE(host.step() >= 0);
      double h = 0.0;
      IDAGetLastStep(host.ida, &h);
      if (!output || host.steps() < 15) continue;  // first steps turn C by much
      std::vector<double> between(5);
      N_Vector y = host.vector(between), yp = host.vector(between), whole = host.vector(between);
      const double* p = N_VGetArrayPointer(y);
      const double t = host.t - 0.4 * h;
      REQUIRE(IDAGetDky(host.ida, t, 0, y) == 0);
      REQUIRE(IDAGetDky(host.ida, t, 1, yp) == 0);
      N_VScale(1.0, y, whole);
      const tp::ConsistencyReport report = projection.project(t, y);
      REQUIRE(report);
      CHECK(report.rank == 2);
      CHECK(std::abs(p[0] * p[0] + p[1] * p[1] - 1.0) < 1e-12);
      CHECK(std::abs(p[0] * p[2] + p[1] * p[3]) < 1e-11);
      REQUIRE(projection.project(t, whole, yp));
      N_VLinearSum(1.0, whole, -1.0, y, whole);
      CHECK(N_VMaxNorm(whole) == 0.0);  // with y' as without
    }
    return host.state();
  };
  CHECK(same_bits(end_of(true), end_of(false)));
}

TEST_CASE("project: tangent of a constraint that moves") {
  // x = sin t: x' must be cos t.
  Problem problem = still({0.0, 0.0});
  Host host(problem, 1e-6);
  host.attach(row(
      "dragged", [](double t, const double* y) { return y[0] - std::sin(t); },
      [](double, const double*, double* c) { c[0] = 1.0; }));
  N_Vector velocity = host.vector({0.0, 7.0});
  REQUIRE(host.projection().project(0.8, host.y, velocity));
  CHECK(host.data()[0] == Approx(std::sin(0.8)).epsilon(1e-14));
  CHECK(N_VGetArrayPointer(velocity)[0] == Approx(std::cos(0.8)).epsilon(1e-8));
  CHECK(N_VGetArrayPointer(velocity)[1] == 7.0);
}

TEST_CASE("solve: what IDASolve returns, on the constraints, in every mode") {
  for (const char* form : {"index 1", "index 0"}) {
    INFO(form);
    const Problem problem = pendulum(1.0, 1.0, 20.0, form);
    const tp::Constraints rows = problem.recommended_constraints();
    const auto on_constraints = [&](Host& host) {
      return value(rows, host.t, host.data(), 5).cwiseAbs().maxCoeff() < 5e-12;  // 5e-7 tolerances
    };
    const auto tangent = [&](Host& host) {
      const Eigen::VectorXd rate =
          jacobian(rows, host.t, host.data(), 5) *
          Eigen::Map<const Eigen::VectorXd>(N_VGetArrayPointer(host.yp), 5);
      return rate.cwiseAbs().maxCoeff() < 1e-7;
    };
    Host normal(problem, 1e-5), plain(problem, 1e-5), one(problem, 1e-5), stop(problem, 1e-5);
    for (Host* host : {&normal, &plain, &one, &stop}) host->attach(rows);
    double interpolated_drift = 0.0;
    for (int k = 1; k <= 40; ++k) {
      const double t = 0.5 * k;
      REQUIRE(normal.projection().solve(t, &normal.t, normal.y, normal.yp, IDA_NORMAL) >= 0);
      REQUIRE(plain.to(t) >= 0);
      CHECK(normal.t == t);
      CHECK(on_constraints(normal));
      CHECK(tangent(normal));
      interpolated_drift =
          std::max(interpolated_drift, value(rows, t, plain.data(), 5).cwiseAbs().maxCoeff());
      for (int i = 0; i < 4; ++i) CHECK(std::abs(normal.data()[i] - plain.data()[i]) < 1e-4);
    }
    CHECK(interpolated_drift > 1e-10);       // what solve() took away
    CHECK(normal.steps() == plain.steps());  // and it does not disturb the integration
    while (one.t < 20.0) {
      REQUIRE(one.projection().solve(20.0, &one.t, one.y, one.yp, IDA_ONE_STEP) >= 0);
      CHECK(on_constraints(one));
    }
    REQUIRE(IDASetStopTime(stop.ida, 7.3) == 0);
    CHECK(stop.projection().solve(20.0, &stop.t, stop.y, stop.yp, IDA_NORMAL) == IDA_TSTOP_RETURN);
    CHECK(stop.t == 7.3);
    CHECK(on_constraints(stop));
  }
}

TEST_CASE("make_consistent: a stop time that was reached, or lies behind, is no hindrance") {
  for (const double stop : {0.3, 0.1}) {
    Host host(tether::test::circle(5.0), 1e-6);
    host.attach(on_circle());
    REQUIRE(IDASetStopTime(host.ida, 0.3) == 0);
    REQUIRE(host.to(0.3) >= 0);
    REQUIRE(IDAReInit(host.ida, 0.3, host.y, host.yp) == 0);
    REQUIRE(IDASetStopTime(host.ida, stop) == 0);
    host.data()[0] *= 1.001;
    int errors = 0;
#if SUNDIALS_VERSION_MAJOR < 7
    const IDAErrHandlerFn count = [](int, const char*, const char*, char*, void* n) {
      ++*static_cast<int*>(n);
    };
    REQUIRE(IDASetErrHandlerFn(host.ida, count, &errors) == 0);
#endif
    const tp::ConsistencyReport report = host.projection().make_consistent(0.3, host.y, host.yp);
    INFO(report.message);
    CHECK(report);
    CHECK((errors == 0 || stop < 0.3));  // IDA names a stop time that lies behind
    REQUIRE(IDASetStopTime(host.ida, 0.6) == 0);
    CHECK(host.to(0.6) >= 0);
    CHECK(host.t == Approx(0.6));
  }
}

TEST_CASE("make_consistent: a row that repeats F moves algebraic variables only") {
  // d' = w, w' = 1 - I cos d, 0 = I - k tan d; k jumps, and I with it.
  for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
    const double k = 0.7;
    const auto energy = [k](double d, double w) { return w * w / 2.0 - d - k * std::cos(d); };
    Problem problem =
        ode({0.4, 0.3, 2.0 * std::tan(0.4)}, 1.0, [](double, const double*, double*) {});
    problem.residual = [k](double, const double* y, const double* yp, double* r) {
      r[0] = yp[0] - y[1];
      r[1] = yp[1] - 1.0 + y[2] * std::cos(y[0]);
      r[2] = std::cos(y[0]) * (y[2] * std::cos(y[0]) - k * std::sin(y[0]));
    };
    problem.jacobian = nullptr;
    Host host(problem, tolerance);
    const double value = energy(0.4, 0.3);
    tp::Constraints rows;
    rows.count = 2;
    rows.value = [=](double, tp::ConstVector y, tp::Vector g) {
      g[0] = energy(y[0], y[1]) - value;
      g[1] = y[2] * std::cos(y[0]) - k * std::sin(y[0]);
    };
    host.attach(rows);
    const tp::ConsistencyReport report = host.projection().make_consistent(0.0, host.y, host.yp);
    INFO("tolerance " << tolerance << ": " << report.message);
    CHECK(report);
    CHECK(std::abs(host.data()[0] - 0.4) < 0.1 * tolerance);
    CHECK(std::abs(host.data()[1] - 0.3) < 0.1 * tolerance);
    CHECK(host.data()[2] == Approx(k * std::tan(0.4)));
  }
}
