// Tether: algebraic variables on which nothing depends, and runs that repeat.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <problems/car_axis.hpp>
#include <problems/governor.hpp>
#include <problems/linear_masses.hpp>
#include <problems/pendulum.hpp>
#include <problems/rows.hpp>

#include "host.hpp"
#include "motions.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using tether::problems::car_axis;
using tether::problems::pendulum;

namespace {

// b' = 1, 0 = b - 1 + H - OH, 0 = K - H OH: acid and base, whose other root is H = -1 at the end.
Problem titration() {
  constexpr double kProduct = 1e-6;
  Problem p;
  p.name = "titration";
  p.form = "index 1";
  p.size = 3;
  p.t_end = 2.0;
  const double H = (1 + std::sqrt(1 + 4 * kProduct)) / 2, slope = -1 / (1 + kProduct / (H * H));
  p.y0 = {0.0, H, kProduct / H};
  p.yp0 = {1.0, slope, -kProduct / (H * H) * slope};
  p.id = {1.0, 0.0, 0.0};
  p.residual = [](double, const double* y, const double* yp, double* r) {
    r[0] = yp[0] - 1.0;
    r[1] = y[0] - 1.0 + y[1] - y[2];
    r[2] = kProduct - y[1] * y[2];
  };
  p.reference = {2.0, kProduct / H, H};
  p.error_components = 3;
  p.atol_scale = {1.0, 1e-3, 1e-3};
  return p;
}

// The same with c' = -rate c H, so that c depends on H.
Problem titration_with_decay(double rate) {
  Problem p = titration();
  const auto acid = p.residual;
  p.name = "titration with decay";
  p.size = 4;
  p.y0.push_back(1.0);
  p.yp0.push_back(-rate * p.y0[1]);
  p.id.push_back(1.0);
  p.residual = [=](double t, const double* y, const double* yp, double* r) {
    acid(t, y, yp, r);
    r[3] = yp[3] + rate * y[3] * y[1];
  };
  p.reference.push_back(0.0);
  p.atol_scale.push_back(1.0);
  return p;
}

// A point turns once on a circle; z = sin(2 pi w t) is read.
Problem fast_output(double w) {
  const double turn = 8 * std::atan(1.0);
  Problem p;
  p.name = "fast output";
  p.form = "index 1";
  p.size = 3;
  p.t_end = 1.0;
  p.y0 = {1.0, 0.0, 0.0};
  p.yp0 = {0.0, -turn, turn * w};
  p.id = {1.0, 1.0, 0.0};
  p.residual = [=](double t, const double* y, const double* yp, double* r) {
    r[0] = yp[0] - turn * y[1];
    r[1] = yp[1] + turn * y[0];
    r[2] = y[2] - std::sin(turn * w * t);
  };
  p.reference = {1.0, 0.0, 0.0};
  p.error_components = 2;
  return p;
}

// x, y turn at a rate that depends on y_a a little; F says what y_a is, by `equation`(t, y_a) = 0.
Problem turns_with(double start, double rate, double share, double t_end,
                   const std::function<double(double t, double a)>& equation) {
  const auto speed = [=](double a) { return rate * (1.0 + share * a * a); };
  Problem p = tether::problems::start_problem("turns", "index 1", 2, t_end, {1.0, 0.0, start},
                                              {0.0, speed(start), 0.0}, {1.0, 1.0, 0.0});
  p.residual = [=](double t, const double* y, const double* yp, double* r) {
    r[0] = yp[0] + speed(y[2]) * y[1];
    r[1] = yp[1] - speed(y[2]) * y[0];
    r[2] = equation(t, y[2]);
  };
  return p;
}

}  // namespace

TEST_CASE("outputs: acid and base end at the root that they began at, at any tolerance") {
  const tp::Constraints rows = row(
      "base", [](double t, const double* y) { return y[0] - t; },
      [](double, const double*, double* C) { C[0] = 1.0; });
  const Problem problem = titration();
  for (int k = 0; k < 40; ++k) {
    const double tolerance = std::pow(10.0, -3 - 7.0 * k / 39);
    const Run run = integrate(problem, tolerance, rows, {}, false);
    CAPTURE(tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(std::abs(run.y[1] - problem.reference[1]) < 1e-7);
    CHECK(run.statistics.untested == 0);
  }
}

TEST_CASE("coupled algebraic variables: acid and base keep their root at any tolerance") {
  const tp::Constraints rows = row(
      "base", [](double t, const double* y) { return y[0] - t; },
      [](double, const double*, double* C) { C[0] = 1.0; });
  for (const double rate : {0.01, 0.1, 1.0}) {
    const Problem problem = titration_with_decay(rate);
    for (int k = 0; k < 40; ++k) {
      const double tolerance = std::pow(10.0, -3 - 7.0 * k / 39);
      const Run run = integrate(problem, tolerance, rows, {}, false);
      CAPTURE(rate, tolerance);
      REQUIRE(run.flag >= 0);
      CHECK(std::abs(run.y[1] - problem.reference[1]) < 1e-7);
      CHECK(run.statistics.untested == 0);
    }
  }
}

TEST_CASE("coupled algebraic variables: those that answer to moves do not limit the step") {
  const Problem problem = tether::problems::governor(0.3, "index 1 w");
  for (const double tolerance : {1e-4, 1e-6}) {
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
    CAPTURE(tolerance, run.steps);
    REQUIRE(run.flag >= 0);
    CHECK(run.steps < 600);
    CHECK(run.error < 10 * tolerance);
    CHECK(run.statistics.untested == 0);
  }
}

TEST_CASE("coupled algebraic variables: forces that are switched are passed") {
  // Accelerations and the force in the link jump; plain IDA's steps go to zero before that.
  const Problem masses = tether::problems::linear_masses("index 1");
  for (const double tolerance : {1e-3, 1e-5, 1e-7, 1e-9}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(masses, tolerance, masses.recommended_constraints(), {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.error <= 30.0 * tolerance);
    CHECK(run.steps <= 400);
  }
}

namespace {

/// On in every second interval of 0.37: 27 jumps until t = 10.
double switched_force(double t) { return static_cast<long>(t / 0.37) % 2 == 1 ? 5.0 : 0.0; }

double worst(const Run& run, const Run& exact) {
  double error = 0.0;
  for (std::size_t i = 0; i < 4; ++i) error = std::max(error, std::abs(run.y[i] - exact.y[i]));
  return error;
}

}  // namespace

TEST_CASE("coupled algebraic variables: 27 jumps of a force are passed") {
  Problem swing = pendulum(1.0, 9.81, 10.0, "index 1");
  swing.residual = [quiet = swing.residual](double t, const double* y, const double* yp,
                                            double* r) {
    quiet(t, y, yp, r);
    r[2] -= switched_force(t);
    r[4] += switched_force(t) * y[0];
  };
  const tp::Constraints rows = swing.select({"position", "velocity"});
  const Run exact = integrate(swing, 1e-10, rows, {}, false);
  for (const double tolerance : {7.5e-5, 1e-6, 1e-8}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(swing, tolerance, rows, {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.status == tp::Status::success);
    CHECK(run.steps <= 3500);
    CHECK(worst(run, exact) <= 500.0 * tolerance);
  }
}

TEST_CASE(
    "coupled algebraic variables: an oscillation that grows out of the tolerance is resolved") {
  const auto root = [](double t) {
    return 2.5 * (0.5 + 0.5 * std::tanh((t - 300.0) / 20.0)) * std::sin(3.0 * t);
  };
  const Problem problem =
      turns_with(0.0, 0.01, 1e-3, 660.0, [=](double t, double a) { return a - root(t); });
  for (const double tolerance : {1e-4, 1e-6}) {
    double largest[2] = {0.0, 0.0};  // of plain IDA, and projected
    for (const bool projected : {false, true}) {
      Host host(problem, tolerance);
      if (projected) host.attach(on_circle());
      for (double t = 100.0; t < 650.0; t += 7.31) {
        REQUIRE(host.to(t) >= 0);
        largest[projected] = std::max(largest[projected], std::abs(host.data()[2] - root(t)));
      }
    }
    INFO("tolerance " << tolerance);
    CHECK(largest[1] <= 2.0 * largest[0]);
  }
}

TEST_CASE("coupled algebraic variables: nearly dependent rows do not take them out of the test") {
  for (const double width : {0.5, 0.1})
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      // A front of this width to a value at which other roots are near.
      const auto root = [=](double t) { return 5.0 * std::tanh((t - 30.0) / width); };
      Problem problem =
          tether::problems::start_problem("two turn", "index 1", 4, 60.0, {1, 0, 1, 0, root(0.0)},
                                          {0, 0.01, 0, 0.02, 0}, {1, 1, 1, 1, 0});
      problem.residual = [=](double t, const double* y, const double* yp, double* r) {
        const double rate = 0.01 * (1.0 + 0.3 * std::sin(y[4] / 2.0));
        r[0] = yp[0] + rate * y[1];
        r[1] = yp[1] - rate * y[0];
        r[2] = yp[2] + 2.0 * rate * y[3];
        r[3] = yp[3] - 2.0 * rate * y[2];
        r[4] = std::sin(y[4] - root(t));
      };
      const tp::Constraints rows =
          on_circle() + row(
                            "both",
                            [](double, const double* y) {
                              return (y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0 +
                                     5e-5 * (y[2] * y[2] + y[3] * y[3] - 1.0);
                            },
                            [](double, const double* y, double* C) {
                              C[0] = y[0];
                              C[1] = y[1];
                              C[2] = 1e-4 * y[2];
                              C[3] = 1e-4 * y[3];
                            });
      Host host(problem, tolerance);
      host.attach(rows);
      INFO("width " << width << ", tolerance " << tolerance);
      REQUIRE(host.to(60.0) >= 0);
      CHECK(std::abs(host.data()[4] - root(60.0)) <= 0.5);
    }
}

TEST_CASE("coupled algebraic variables: a start off their equations is healed, as IDA heals it") {
  for (const double off : {1e-3, 1e-2})
    for (const double tolerance : {1e-4, 1e-6}) {
      Problem problem =
          turns_with(1.0 + off, 0.5, 1.0, 10.0, [](double, double a) { return a * a * a - 1.0; });
      problem.yp0[1] = 1.0;
      Host host(problem, tolerance);
      IDASetId(host.ida, host.vector(problem.id));
      IDASetSuppressAlg(host.ida, 1);
      host.attach(on_circle());
      INFO("off by " << off << ", tolerance " << tolerance);
      REQUIRE(host.to(10.0) >= 0);
      CHECK(std::abs(host.data()[0] - std::cos(10.0)) <= 100.0 * tolerance);
      CHECK(std::abs(host.data()[2] - 1.0) <= 10.0 * tolerance);
    }
}

TEST_CASE("a long move does not hide a jump of F from the error test") {
  // Near the lowest point the shortest move in the metric takes the new speed back.
  const Problem swing = ode({1.0, 0.0, 0.0, 0.0}, 10.0, [](double t, const double* y, double* f) {
    const double force = switched_force(t);
    const double pull =
        (y[2] * y[2] + y[3] * y[3] + force * y[0] - 9.81 * y[1]) / (y[0] * y[0] + y[1] * y[1]);
    f[0] = y[2];
    f[1] = y[3];
    f[2] = force - pull * y[0];
    f[3] = -9.81 - pull * y[1];
  });
  const tp::Constraints rows =
      pendulum(1.0, 9.81, 10.0, "index 1").select({"position", "velocity"});
  const Run exact = integrate_plain(swing, 1e-11);
  double ratios = 0.0;
  for (int k = 8; k < 16; ++k) {
    const double tolerance = 1e-3 * std::pow(10.0, -k / 8.0);
    INFO("tolerance " << tolerance);
    const double ours = worst(integrate(swing, tolerance, rows, {}, false), exact);
    const double plain = worst(integrate_plain(swing, tolerance), exact);
    CHECK(ours <= 3.0 * plain);
    ratios += std::log(ours / plain);
  }
  CHECK(std::exp(ratios / 8) <= 0.5);
}

TEST_CASE("outputs: values between steps are right to the tolerance, as plain IDA's") {
  for (const double w : {10.0, 100.0})
    for (const double tolerance : {1e-4, 1e-6}) {
      double worst[2] = {0.0, 0.0};
      for (const bool projects : {false, true}) {
        Host host(fast_output(w), tolerance);
        if (projects) host.attach(on_circle());
        for (int i = 1; i <= 200; ++i) {
          const double t = i / 200.0;
          REQUIRE(host.to(t) >= 0);
          const double z = std::sin(8 * std::atan(1.0) * w * t);
          worst[projects] = std::max(worst[projects], std::abs(host.data()[2] - z));
        }
      }
      CAPTURE(w, tolerance);
      CHECK(worst[1] <= 1.5 * worst[0]);
      CHECK(worst[1] < 10 * tolerance);
    }
}

TEST_CASE("outputs: a row that moves nothing but an output is named, and does no harm") {
  const double w = 10.0, turn = 8 * std::atan(1.0);
  const tp::Constraints output = row(
      "output", [=](double t, const double* y) { return y[2] - std::sin(turn * w * t); },
      [](double, const double*, double* C) { C[2] = 1.0; });
  const Run with = integrate(fast_output(w), 1e-6, on_circle() + output, {}, false);
  const Run without = integrate(fast_output(w), 1e-6, on_circle(), {}, false);
  REQUIRE(with.flag >= 0);
  CHECK(with.status == tp::Status::success);
  CHECK(with.message.find("row 1 (output)") != std::string::npos);
  CHECK(with.error < 1.5 * without.error);
  CHECK(without.message.empty());
}

TEST_CASE("runs repeat: IDAReInit gives the first run to the bit, in every form") {
  for (const char* form : {"index 1", "index 2", "GGL", "index 0"})
    for (const double tolerance : {1e-4, 1e-6, 1e-7, 1e-8})
      for (const bool car : {false, true}) {
        if (car && form == std::string("index 0")) continue;
        const Problem problem = car ? car_axis(form) : pendulum(1.0, 1.0, 10.0, form);
        Host host(problem, tolerance);
        host.attach(problem.recommended_constraints());
        CAPTURE(problem.name, form, tolerance);
        REQUIRE(host.finish() >= 0);
        const std::vector<double> first = host.state();
        const long steps = host.steps();
        const long asked = host.projection().statistics().residual_evaluations;
        host.projection().reset_statistics();
        REQUIRE(host.restart() == 0);
        REQUIRE(host.finish() >= 0);
        CHECK(host.steps() == steps);
        CHECK(host.state() == first);
        // F has been asked once what it is like.
        CHECK(host.projection().statistics().residual_evaluations <= asked);
      }
}
