// Tether: time-dependent constraints, odd weights, roots and stops. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <limits>
#include <problems/car_axis.hpp>
#include <problems/governor.hpp>
#include <problems/nand_gate.hpp>
#include <problems/pendulum.hpp>
#include <problems/rows.hpp>
#include <problems/slider_crank.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// 1 / (rtol |y| + atol) as IDA computes it, times a factor for each component.
int weights(N_Vector y, N_Vector ewt, void* data) {
  // IDA hands over its user_data, the host's problem: factors and tolerance travel in there.
  const auto& problem = *static_cast<Problem*>(data);
  for (int i = 0; i < problem.size; ++i)
    N_VGetArrayPointer(ewt)[i] =
        problem.atol_scale[static_cast<std::size_t>(i)] /
        (problem.initial_step * std::abs(N_VGetArrayPointer(y)[i]) + problem.initial_step);
  return 0;
}

/// rtol = atol = tolerance by IDAWFtolerances, each weight times a factor.
void set_weights(Host& host, double tolerance, std::vector<double> factor) {
  host.problem.atol_scale = std::move(factor);
  host.problem.initial_step = tolerance;
  REQUIRE(IDAWFtolerances(host.ida, weights) == 0);
}

}  // namespace

TEST_CASE("time-dependent constraint: kept at the time of every step") {
  // A point dragged along x = sin t, y free: y' = x.
  const Problem problem = ode({0.0, 0.0}, 20.0, [](double t, const double* y, double* f) {
    f[0] = std::cos(t);
    f[1] = y[0];
  });
  const tp::Constraints dragged = row(
      "dragged", [](double t, const double* y) { return y[0] - std::sin(t); },
      [](double, const double*, double* c) { c[0] = 1.0; });
  const Run run = integrate(problem, 1e-6, dragged);
  REQUIRE(run.flag >= 0);
  CHECK(run.drift < 1e-14);
  CHECK(std::abs(run.y[1] - (1.0 - std::cos(20.0))) < 1e-5);
  CHECK(run.steps < 300);

  const Problem car = car_axis("index 1");
  const Run on_road = integrate(car, 1e-6, car.recommended_constraints());
  REQUIRE(on_road.flag >= 0);
  CHECK(on_road.distance <= tp::Options().advanced.tolerance);
}

TEST_CASE("a constraint that the equations do not keep is enforced all the same") {
  // The equations only drift along; g asks for a circle that grows slowly.
  const Problem problem = circle(5.0);
  const tp::Constraints growing = row(
      "growing",
      [](double t, const double* y) {
        return y[0] * y[0] + y[1] * y[1] - (1.0 + 1e-4 * t) * (1.0 + 1e-4 * t);
      },
      [](double, const double* y, double* c) {
        c[0] = 2.0 * y[0];
        c[1] = 2.0 * y[1];
      });
  const Run run = integrate(problem, 1e-4, growing);
  REQUIRE(run.flag >= 0);
  CHECK(run.distance <= tp::Options().advanced.tolerance);
  Host host(problem, 1e-4);
  host.attach(growing);
  IDASetStopTime(host.ida, problem.t_end);  // what IDA interpolates lies beside the circle
  while (host.t < problem.t_end) REQUIRE(host.step() >= 0);
  CHECK(std::hypot(host.data()[0], host.data()[1]) == Approx(1.0005).epsilon(1e-8));
}

TEST_CASE("user weights equal to IDA's own: the same bits") {
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 1");
  Host scalar(problem, 1e-6), user(problem, 1e-6);
  set_weights(user, 1e-6, std::vector<double>(5, 1.0));
  scalar.attach(problem.recommended_constraints());
  user.attach(problem.recommended_constraints());
  REQUIRE(scalar.finish() >= 0);
  REQUIRE(user.finish() >= 0);
  CHECK(scalar.steps() == user.steps());
  CHECK(same_bits(scalar.state(), user.state()));
}

TEST_CASE("zero weights: a component without error control is still projected") {
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 1");
  const tp::Constraints rows = problem.recommended_constraints();
  for (const int without : {4, 1, 3}) {  // the multiplier, a position, a velocity
    for (const tp::Metric metric : {tp::Metric::local_correction, tp::Metric::error_weights}) {
      INFO("component " << without << ", metric " << static_cast<int>(metric));
      Host host(problem, 1e-6);
      std::vector<double> factor(5, 1.0);
      factor[static_cast<std::size_t>(without)] = 0.0;
      set_weights(host, 1e-6, factor);
      tp::Options options;
      options.advanced.metric = metric;
      host.attach(rows, options);
      double drift = 0.0;
      while (host.t < problem.t_end) {
        REQUIRE(host.step() >= 0);
        drift = std::max(drift, value(rows, host.t, host.data(), 5).cwiseAbs().maxCoeff());
      }
      CHECK(drift < 1e-8);
      CHECK(host.finish() >= 0);
      CHECK(host.steps() < 1200);
      CHECK(host.error() < 1e-3);
    }
  }
}

TEST_CASE("loose weight on a multiplier: nothing is dumped there") {
  // Index 0: the multiplier takes part in the projection. Its tolerance is a million times larger.
  Problem loose = pendulum(1.0, 1.0, 20.0, "index 0");
  const tp::Constraints rows = loose.recommended_constraints();
  const Run tight = integrate(loose, 1e-7, rows);
  loose.atol_scale = {1.0, 1.0, 1.0, 1.0, 1e6};
  for (const tp::Metric metric : {tp::Metric::local_correction, tp::Metric::error_weights}) {
    tp::Options options;
    options.advanced.metric = metric;
    const Run run = integrate(loose, 1e-7, rows, options);
    INFO("metric " << static_cast<int>(metric) << ", tight: " << tight.error);
    REQUIRE(run.flag >= 0);
    CHECK(run.drift < 1e-9);
    CHECK(run.error < 1e-5);
    CHECK(std::abs(run.y[4] - loose.reference[4]) < 1e-5);
    CHECK(run.steps < 2 * tight.steps);
  }
  // Index 1, suppressed or not.
  Problem index1 = pendulum(1.0, 1.0, 20.0, "index 1");
  index1.atol_scale = {1.0, 1.0, 1.0, 1.0, 1e4};
  for (const bool suppress : {true, false}) {
    tp::Options options;
    options.suppress_algebraic = suppress;
    const Run run = integrate(index1, 1e-7, index1.recommended_constraints(), options);
    REQUIRE(run.flag >= 0);
    CHECK(run.error < 1e-5);
    CHECK(std::abs(run.y[4] - index1.reference[4]) < 1e-5);
  }
}

TEST_CASE("charges that F keeps: voltages follow them, whatever their tolerances") {
  Problem gate = tether::problems::nand_gate("index 1");
  const auto nodes = static_cast<std::ptrdiff_t>(gate.atol_scale.size()) / 2;
  for (const double unit : {1.0, 1e-3, 6e-5})
    for (const double tolerance : {1e-4, 1e-6}) {
      std::fill(gate.atol_scale.begin() + nodes, gate.atol_scale.end(), unit);
      const Run run = integrate(gate, tolerance, gate.recommended_constraints(), {}, false);
      INFO("charges in units of " << unit << ", tolerance " << tolerance << ": " << run.error);
      REQUIRE(run.flag >= 0);
      CHECK(run.error < 5.0 * tolerance);
      CHECK(run.steps < 5000);  // plain IDA: 1400 and 3300 to 3700
    }
}

TEST_CASE("charges of capacitors that are not linear: what moves leave is no response of F") {
  // q_i' = 2 C_i sin 3 t - C_i v_i - current to the other, q_i = c_i (v_i + 0.3 v_i^3).
  for (const double C : {1e-2, 1e-3, 1e-4}) {
    const auto charge = [C](int i, const double* y) {
      return (i == 0 ? C : 0.1 * C) * (y[i] + 0.3 * y[i] * y[i] * y[i]) - y[2 + i];
    };
    Problem p = tether::problems::start_problem("two capacitors", "index 1", 2, 10.0,
                                                std::vector<double>(4, 0.0),
                                                std::vector<double>(4, 0.0), {0.0, 0.0, 1.0, 1.0});
    p.residual = [=](double t, const double* y, const double* yp, double* r) {
      const double between = C * (y[0] - y[1]);
      r[0] = yp[2] - C * (2.0 * std::sin(3.0 * t) - y[0]) + between;
      r[1] = yp[3] - C * (2.0 * std::sin(3.0 * t) - y[1]) - between;
      for (int i = 0; i < 2; ++i) r[2 + i] = charge(i, y);
    };
    Problem fine = p;
    fine.atol_scale = {1.0, 1.0, 0.1 * C, 0.1 * C};
    const std::vector<double> exact = integrate_plain(fine, 1e-11).y;
    const auto of = [=](int i) {
      return row(
          i == 0 ? "first charge" : "second charge",
          [=](double, const double* y) { return charge(i, y); },
          [=](double, const double* y, double* slope) {
            slope[i] = (i == 0 ? C : 0.1 * C) * (1.0 + 0.9 * y[i] * y[i]);
            slope[2 + i] = -1.0;
          });
    };
    const tp::Constraints charges = of(0) + of(1);
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      const Run run = integrate(p, tolerance, charges);
      INFO("c = " << C << ", tolerance " << tolerance << ": " << run.y[0] << ", " << exact[0]);
      REQUIRE(run.flag >= 0);
      for (int i = 0; i < 2; ++i) CHECK(std::abs(run.y[i] - exact[i]) <= 10.0 * tolerance);
    }
  }
}

TEST_CASE("a start that IDA finds by refusals: voltages stay in its error test") {
  // q' = a sin t - g v, q = c v: v = a (sin t - T cos t + T exp(-t / T)) / (g (1 + T^2)), T = c /
  // g.
  constexpr double kEnd = 10.0, a = 1e-6, g = 1e-6;
  for (const double c : {1e-8, 1e-9, 1e-10}) {
    Problem p = tether::problems::start_problem("one capacitor", "index 1", 1, kEnd, {0.0, 0.0},
                                                {0.0, 0.0}, {0.0, 1.0});
    p.residual = [c](double t, const double* y, const double* yp, double* r) {
      r[0] = yp[1] - a * std::sin(t) + g * y[0];
      r[1] = c * y[0] - y[1];
    };
    const double T = c / g;
    p.reference = {a * (std::sin(kEnd) - T * std::cos(kEnd)) / (g * (1.0 + T * T)), std::nan("")};
    const tp::Constraints charge = row(
        "charge", [c](double, const double* y) { return c * y[0] - y[1]; },
        [c](double, const double*, double* C) {
          C[0] = c;
          C[1] = -1.0;
        });
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      const Run plain = integrate_plain(p, tolerance), run = integrate(p, tolerance, charge);
      INFO("c = " << c << ", tolerance " << tolerance << ": " << run.error << ", plain "
                  << plain.error);
      REQUIRE(run.flag >= 0);
      CHECK(run.error <= 3.0 * plain.error + tolerance);
      CHECK(run.statistics.untested == 0);
    }
  }
}

TEST_CASE("a first step that moves y' by its length over a short step: the corrector finds it") {
  // A capacitor q behind a resistor; its power is quadratic in q'. Row: the work is in the charge.
  constexpr double R = 0.1;
  for (const double tolerance : {1e-4, 1e-6}) {
    Problem p = tether::problems::start_problem(
        "charging", "index 0", 1, 2.0, {0.5, 0.125 - 1e-3 * tolerance}, {5.0, 2.5}, {1.0, 1.0});
    p.initial_step = 1e-10;
    p.residual = [](double t, const double* y, const double* yp, double* r) {
      r[0] = y[0] + R * yp[0] - std::cos(t);
      r[1] = yp[1] - yp[0] * (std::cos(t) - R * yp[0]);
    };
    const tp::Constraints work = row(
        "work", [](double, const double* y) { return y[1] - 0.5 * y[0] * y[0]; },
        [](double, const double* y, double* C) {
          C[0] = -y[0];
          C[1] = 1.0;
        });
    const Run plain = integrate_plain(p, tolerance), run = integrate(p, tolerance, work);
    INFO("tolerance " << tolerance << ": " << run.message);
    REQUIRE(plain.flag >= 0);
    REQUIRE(run.flag >= 0);
    CHECK(run.steps < 1.2 * plain.steps);
    CHECK(std::abs(run.y[0] - plain.y[0]) < 10.0 * tolerance);
  }
}

TEST_CASE("an energy in voltages that are zero at the start: all charges move with it") {
  // Two capacitors behind resistors of 1; W' is the power into them.
  static constexpr double C[2] = {0.5, 1.0};
  Problem p =
      tether::problems::start_problem("ladder", "index 1", 2, 6.0, std::vector<double>(5, 0.0),
                                      std::vector<double>(5, 0.0), {0.0, 0.0, 1.0, 1.0, 1.0});
  p.residual = [](double t, const double* y, const double* yp, double* r) {
    const double between = y[0] - y[1];
    const double charging[2] = {2.0 * std::sin(2.0 * t) - y[0] - between, between - y[1]};
    r[4] = yp[4];
    for (int i = 0; i < 2; ++i) {
      r[i] = yp[2 + i] - charging[i];
      r[2 + i] = C[i] * y[i] - y[2 + i];
      r[4] -= y[i] * charging[i];
    }
  };
  const std::vector<double> exact = integrate_plain(p, 1e-11).y;
  p.atol_scale = {0.1, 0.1, 1.0, 1.0, 1.0};
  const tp::Constraints energy = row(
      "energy",
      [](double, const double* y) {
        return y[4] - 0.5 * (C[0] * y[0] * y[0] + C[1] * y[1] * y[1]);
      },
      [](double, const double* y, double* slope) {
        for (int i = 0; i < 2; ++i) slope[i] = -C[i] * y[i];
        slope[4] = 1.0;
      });
  for (const double tolerance : {1e-6, 1e-8}) {
    const Run run = integrate(p, tolerance, energy);
    REQUIRE(run.flag >= 0);
    for (std::size_t i = 0; i < 5; ++i) {
      INFO("y[" << i << "] at tolerance " << tolerance << ": " << run.y[i] << ", " << exact[i]);
      CHECK(std::abs(run.y[i] - exact[i]) <= 10.0 * tolerance);
    }
  }
}

TEST_CASE("columns of what is held may become infinite: nothing moves along them") {
  // x falls through 0; lam = u + x^1.5 for x > 0, and the derivative of that is told as infinite
  // for x < 0.
  const auto h = [](double x) { return x > 0.0 ? std::pow(x, 1.5) : 0.0; };
  const auto slope = [](double x) {
    return x > 0.0 ? 1.5 * std::sqrt(x) : std::numeric_limits<double>::infinity();
  };
  Problem p;
  p.size = 4;
  p.t_end = 6.0;
  p.y0 = {2.0, 1.0, 0.0, 1.0 + h(2.0)};
  p.yp0 = {-1.0, 0.0, 1.0, -slope(2.0)};
  p.id = {1, 1, 1, 0};
  p.reference = {-4.0, std::cos(6.0), std::sin(6.0), std::cos(6.0)};
  p.residual = [h](double, const double* y, const double* yp, double* r) {
    r[0] = yp[0] + 1.0;
    r[1] = yp[1] + y[2];
    r[2] = yp[2] - y[1];
    r[3] = y[3] - y[1] - h(y[0]);
  };
  tp::Constraints rows;
  rows.names = {"circle", "flow"};
  rows.count = 2;
  rows.value = [h](double, tp::ConstVector y, tp::Vector g) {
    g << (y[1] * y[1] + y[2] * y[2] - 1.0) / 2.0, y[3] - y[1] - h(y[0]);
    return 0;
  };
  rows.jacobian = tp::DenseJacobian([slope](double, tp::ConstVector y, tp::Matrix C) {
    C << 0.0, y[1], y[2], 0.0, -slope(y[0]), -1.0, 0.0, 1.0;
    return 0;
  });
  tp::Options options;
  options.hold = {true, false, false, false};
  for (const bool sparse : {false, true}) {
    const Run run = integrate(p, 1e-6, sparse ? as_sparse(rows, 4) : rows, options, false);
    INFO(run.message);
    CHECK(run.flag >= 0);
    CHECK(run.error < 1e-4);
  }
}

TEST_CASE("root finding: times of the lowest point, returned on the constraints") {
  const Problem problem = pendulum(1.0, 9.80665, 20.0, "index 1");
  const tp::Constraints rows = problem.recommended_constraints();
  Host host(problem, 1e-8);
  host.attach(rows);
  const IDARootFn lowest = [](sunrealtype, N_Vector y, N_Vector, sunrealtype* out, void*) {
    out[0] = N_VGetArrayPointer(y)[0];
    return 0;
  };
  REQUIRE(IDARootInit(host.ida, 1, lowest) == 0);
  const double quarter = pendulum_period(1.0, 9.80665) / 4.0;
  for (int k = 0; k < 10; ++k) {
    REQUIRE(host.projection().solve(20.0, &host.t, host.y, host.yp, IDA_NORMAL) == IDA_ROOT_RETURN);
    CHECK(std::abs(host.t - (2 * k + 1) * quarter) < 1e-6);
    CHECK(value(rows, host.t, host.data(), 5).cwiseAbs().maxCoeff() < 1e-14);
    CHECK(host.projection().status() == tp::Status::success);
  }
  CHECK(host.steps() < 5200);
}

TEST_CASE("stop time: reached exactly, on the constraints, and left again") {
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 1");
  const tp::Constraints rows = problem.recommended_constraints();
  Host host(problem, 1e-7);
  host.attach(rows);
  for (const double stop : {0.1, 3.0, 3.0000001, 11.7, 20.0}) {
    REQUIRE(IDASetStopTime(host.ida, stop) == 0);
    REQUIRE(host.to(25.0) == IDA_TSTOP_RETURN);
    CHECK(host.t == stop);
    double exact[5];
    pendulum_exact(1.0, 1.0, stop, exact);
    for (int i = 0; i < 4; ++i) CHECK(std::abs(host.data()[i] - exact[i]) < 1e-5);
    CHECK(distance(host, rows) < 2.0 * tp::Options().advanced.tolerance);
  }
  CHECK(host.steps() < 1000);
}

TEST_CASE("IDA stuck before the first move: algebraic variables leave its error test at once") {
  // Accelerations and multipliers of velocity rows fail the error test while the constraints are
  // still met to rounding, so that no move would ever begin.
  const Problem axis = car_axis("GGL w");
  for (const double tolerance : {1e-7, 1e-9}) {
    INFO("car axis, tolerance " << tolerance);
    const Run run = integrate(axis, tolerance, axis.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.steps <= 7000);
    CHECK(run.error <= 1e4 * tolerance);
    CHECK(run.drift <= 1e-9);
  }
  const Problem crank = slider_crank("GGL w");
  for (const double tolerance : {1e-6, 1e-7}) {
    INFO("slider crank, tolerance " << tolerance);
    const Run run = integrate(crank, tolerance, crank.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.steps <= 9000);
    CHECK(run.error <= 10.0 * tolerance);
  }
}

TEST_CASE("IDA stuck in its first step: few refusals are enough") {
  // The index is 1, and the start satisfies the constraints: nothing else begins.
  for (const double tolerance : {1e-8, 1e-9}) {
    INFO("tolerance " << tolerance);
    const Problem axis = car_axis("index 1 w");
    Host host(axis, tolerance);
    host.attach(axis.recommended_constraints());
    REQUIRE(host.step() >= 0);
    long refused = 0;
    IDAGetNumErrTestFails(host.ida, &refused);
    CHECK(refused <= 4);
    CHECK(host.projection().statistics().projections <= 2);
  }
}

TEST_CASE("forms of index 2 close to rounding: multipliers in Newton's test fail, and say so") {
  const Problem problem = pendulum(1.0, 9.81, 10.0, "GGL");
  const tp::Constraints rows = problem.recommended_constraints();
  tp::Options tested;
  tested.suppress_algebraic = false;
  const Run failed = integrate(problem, 1e-8, rows, tested, false);
  REQUIRE(failed.flag < 0);
  CHECK((failed.status == tp::Status::corrector_failed || failed.status == tp::Status::collapsed));
  CHECK(failed.message.find("index 1 or 0") != std::string::npos);
  const Run run = integrate(problem, 1e-12, rows, {}, false);
  REQUIRE(run.flag >= 0);
  CHECK(run.error <= 1e-10);
  CHECK(run.steps <= 10000);
}

// x' = u, u' = f(lambda) + f0 - x - u |u| / 2, u = cos 4t. A wrong lambda leaves u as it is, so
// that Newton's test of lambda alone finds it; f(lambda) = log lambda, 10 tanh lambda from 0, and
// asinh lambda from 0, which failed corrections must not take out of the test.
TEST_CASE("forms of index 2: F that is not affine in a multiplier") {
  constexpr double kRate = 4.0;
  struct Law {
    double (*f)(double);
    double (*inverse)(double);
    double f0;
  };
  const Law laws[] = {
      {[](double x) { return std::log(x); }, [](double f) { return std::exp(f); }, 0.0},
      {[](double x) { return 10.0 * std::tanh(x); }, [](double f) { return std::atanh(f / 10.0); },
       0.5},
      {[](double x) { return std::asinh(x); }, [](double f) { return std::sinh(f); }, 0.5}};
  for (const Law& law : laws) {
    const auto multiplier = [&](double t) {
      const double s = std::sin(kRate * t), c = std::cos(kRate * t);
      return law.inverse(s / kRate - kRate * s + 0.5 * c * std::abs(c) - law.f0);
    };
    Problem p;
    p.index = 2;
    p.size = 3;
    p.t_end = 10.0;
    p.id = {1, 1, 0};
    p.y0 = {0.0, 1.0, multiplier(0.0)};
    p.yp0 = {1.0, 0.0, 0.0};
    p.residual = [&law](double t, const double* y, const double* yp, double* r) {
      r[0] = yp[0] - y[1];
      r[1] = yp[1] - law.f(y[2]) - law.f0 + y[0] + 0.5 * y[1] * std::abs(y[1]);
      r[2] = y[1] - std::cos(kRate * t);
    };
    tp::Constraints rows;
    rows.count = 2;
    rows.value = [](double t, tp::ConstVector y, tp::Vector g) {
      g[0] = y[0] - std::sin(kRate * t) / kRate;
      g[1] = y[1] - std::cos(kRate * t);
    };
    for (const double tolerance : {1e-4, 1e-5, 1e-6}) {
      INFO("law " << &law - laws << ", tolerance " << tolerance);
      Host host(p, tolerance);
      host.attach(rows);
      REQUIRE(host.finish() >= 0);
      const double right = multiplier(p.t_end);
      CHECK(std::abs(host.data()[2] - right) <= 100.0 * tolerance * (1.0 + std::abs(right)));
      CHECK(host.steps() <= 1000);
    }
  }
}

TEST_CASE("forms of index 2: rounding of multipliers in the first steps passes Newton's test") {
  const Problem problem = governor(1.0, "index 2 w");
  for (const double tolerance : {1e-7, 1e-8}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.error <= 100.0 * tolerance);
    CHECK(run.steps <= 1500);
  }
}
