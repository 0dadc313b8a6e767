// Tether: wrong rows and tolerances are named in the first steps. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/governor.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "motions.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// The message after so many steps.
struct Said {
  tp::Status status;
  std::string message;
};

Said after(long steps, const Problem& problem, double tolerance, const tp::Constraints& rows,
           double wrong_slope = 1.0) {
  Host host(problem, tolerance);
  for (int j = 0; j < problem.size; ++j) N_VGetArrayPointer(host.yp)[j] *= wrong_slope;
  host.attach(rows);
  int flag = 0;
  while (host.steps() < steps && host.t < problem.t_end && flag >= 0) flag = host.step();
  return {host.projection().status(), host.projection().message()};
}

/// Energy of the pendulum with this gravity, as it is at (x, y, vx, vy) = start.
tp::Constraints energy_with(double gravity, const std::vector<double>& start) {
  const auto H = [gravity](const double* y) {
    return 0.5 * (y[2] * y[2] + y[3] * y[3]) + gravity * y[1];
  };
  const double value = H(start.data());
  return row(
      "energy", [H, value](double, const double* y) { return H(y) - value; },
      [gravity](double, const double* y, double* c) {
        c[1] = gravity;
        c[2] = y[2];
        c[3] = y[3];
      });
}

}  // namespace

TEST_CASE("an energy row with gravity off by 5 % is named in the first steps") {
  for (const char* form : {"index 1", "index 0"})
    for (const double tolerance : {1e-3, 1e-5, 1e-8}) {
      INFO(form << ", tolerance " << tolerance);
      const Problem problem = pendulum(1.7, 3.3, 100.0, form);
      // In index 0 F keeps velocities only with the force that the accelerations ask for.
      const bool index0 = form == std::string("index 0");
      const tp::Constraints geometry =
          index0 ? problem.select({"position", "velocity", "acceleration"})
                 : problem.select({"position", "velocity"});
      const Said wrong =
          after(100, problem, tolerance, geometry + energy_with(0.95 * 3.3, problem.y0));
      CHECK(wrong.status == tp::Status::doubtful);
      CHECK(contains(wrong.message,
                     index0 ? "F does not keep row 3 (energy)" : "F does not keep row 2 (energy)"));
      const Said right = after(100, problem, tolerance, geometry + energy_with(3.3, problem.y0));
      CHECK(right.status == tp::Status::success);
      CHECK(right.message.empty());
      // The host's y' at the start is no evidence.
      CHECK(after(100, problem, tolerance, geometry, 3.0).message.empty());
    }
}

TEST_CASE("the same where the terms of C y' cancel each other: a point on a sphere") {
  for (const char* form : {"index 1", "index 0"})
    for (const double tolerance : {1e-5, 3e-6, 1e-6, 1e-8}) {
      INFO(form << ", tolerance " << tolerance);
      const Problem problem = spherical_pendulum(form, 100.0);
      const auto energy = [&problem](double gravity) {
        const double start = 0.5 * 1.5 * 1.5 + gravity * problem.y0[2];
        return row(
            "energy",
            [=](double, const double* y) {
              return 0.5 * (y[3] * y[3] + y[4] * y[4] + y[5] * y[5]) + gravity * y[2] - start;
            },
            [=](double, const double* y, double* c) {
              c[2] = gravity;
              std::copy(y + 3, y + 6, c + 3);
            });
      };
      const tp::Constraints geometry = problem.select({"position", "velocity"});
      const Said wrong = after(100, problem, tolerance, geometry + energy(1.05));
      CHECK(wrong.status == tp::Status::doubtful);
      CHECK(contains(wrong.message, "F does not keep row 2 (energy)"));
      CHECK(after(100, problem, tolerance, geometry + energy(1.0)).message.empty());
    }
}

TEST_CASE("a row that is no invariant is named, true at the start as it may be") {
  const Problem problem = pendulum(1.0, 1.0, 100.0, "index 0");
  const tp::Constraints product = row(
      "x vx", [](double, const double* y) { return y[0] * y[2]; },
      [](double, const double* y, double* c) {
        c[0] = y[2];
        c[2] = y[0];
      });
  const Said said = after(100, problem, 1e-6, product);
  CHECK(said.status == tp::Status::doubtful);
  CHECK(contains(said.message, "F does not keep row 0 (x vx)"));
}

TEST_CASE("a row that moves with t is no alarm, and one whose g_t is wrong is") {
  // x' = -sin t, so x = cos t.
  Problem problem =
      ode({1.0}, 20.0, [](double t, const double*, double* f) { f[0] = -std::sin(t); });
  for (const double amplitude : {1.0, 1.1}) {
    const tp::Constraints moving = row(
        "path",
        [amplitude](double t, const double* y) {
          return y[0] - 1.0 - amplitude * (std::cos(t) - 1.0);
        },
        [](double, const double*, double* c) { c[0] = 1.0; });
    const Said said = after(60, problem, 1e-6, moving);
    CHECK((said.status == tp::Status::doubtful) == (amplitude != 1.0));
  }
}

TEST_CASE("rows that vanish are looked at together, by a few evaluations of g") {
  // Hosts that take rows out leave such ones: a scene of forty four-bars has two hundred.
  const Problem problem = pendulum(1.7, 3.3, 100.0, "index 1");
  long evaluations = 0;
  tp::Constraints none;
  none.count = 200;
  none.value = [&evaluations](double, tp::ConstVector, tp::Vector g) {
    ++evaluations;
    g.setZero();
  };
  none.jacobian = tp::DenseJacobian([](double, tp::ConstVector, tp::Matrix) {});
  Host host(problem, 1e-6);
  tp::Projection& projection = host.attach(problem.select({"position", "velocity"}) + none);
  while (host.steps() < 50) REQUIRE(host.step() >= 0);
  CHECK(projection.status() == tp::Status::success);
  CHECK(evaluations <= projection.statistics().value_evaluations + 10);
}

TEST_CASE("atol above the solution is said, at rest it is not") {
  Problem small = tether::test::circle(100.0);
  for (double& value : small.y0) value *= 1e-3;
  for (double& value : small.yp0) value *= 1e-3;
  const Said said = after(12, small, 1e-2, circle_of(1e-6, "small circle"));
  CHECK(said.status == tp::Status::doubtful);
  CHECK(contains(said.message, "reduce atol"));
  CHECK(after(12, small, 1e-6, circle_of(1e-6, "small circle")).status == tp::Status::success);
}

TEST_CASE("atol ten times above the solution is said however IDA starts") {
  for (const double t_end : {5.0, 10.0, 20.0, 50.0, 100.0, 500.0}) {
    Problem tiny = tether::test::circle(t_end);
    for (double& value : tiny.y0) value *= 1e-4;
    for (double& value : tiny.yp0) value *= 1e-4;
    const Said said = after(100, tiny, 1e-3, circle_of(1e-8, "tiny circle"));
    INFO("to " << t_end << ": " << said.message);
    CHECK(said.status == tp::Status::doubtful);
    CHECK(contains(said.message, "reduce atol"));
  }
}

TEST_CASE("a solution that decays below its tolerance, or grows from there, is no alarm") {
  for (const double rate : {-1.0, 1.0}) {
    // The same twice.
    Problem problem = ode({rate < 0.0 ? 1.0 : 1e-5, 0.0}, rate < 0.0 ? 40.0 : 12.0,
                          [rate](double, const double* y, double* f) {
                            f[0] = rate * y[0];
                            f[1] = rate * y[1];
                          });
    problem.y0[1] = problem.y0[0];
    problem.yp0[1] = rate * problem.y0[1];
    const tp::Constraints equal = row(
        "equal", [](double, const double* y) { return y[0] * y[0] - y[1] * y[1]; },
        [](double, const double* y, double* c) {
          c[0] = 2.0 * y[0];
          c[1] = -2.0 * y[1];
        });
    const Said said = after(100, problem, 1e-3, equal);
    INFO("rate " << rate << ": " << said.message);
    CHECK(!contains(said.message, "reduce atol"));
  }
}

TEST_CASE("a row that F leaves slowly is named once that is two tolerances, and else it is not") {
  for (const double rate : {0.0, 1e-4, 1e-3, 1e-2})
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
      INFO("rate " << rate << ", tolerance " << tolerance);
      const Problem filling = ode({0.0, 1.0}, 5.0, [rate](double, const double* y, double* f) {
        f[0] = 1.0 - y[0];
        f[1] = -(1.0 - rate) * f[0];
      });
      const Run run =
          integrate(filling, tolerance, tp::linear_invariant({1.0, 1.0}, 1.0, "total"), {}, false);
      const bool felt = rate > 5.0 * tolerance;
      CHECK(run.status == (felt ? tp::Status::doubtful : tp::Status::success));
      CHECK(contains(run.message, "F does not keep row 0 (total)") == felt);
    }
}

TEST_CASE("right rows of stiff mechanisms and at singular positions are no alarm") {
  const auto check = [](const Problem& problem, double tolerance) {
    INFO(problem.name << ", " << problem.form << ", tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
    CHECK(run.flag >= 0);
    CHECK(run.status == tp::Status::success);
  };
  // Moments of the governor's springs make the iteration for y' slow.
  for (const double tolerance : {1e-7, 8.7e-7}) check(governor(1.0, "index 1 w"), tolerance);
  for (const double tolerance : {3e-5, 3e-8}) check(governor(1.0, "index 0"), tolerance);
  // All four bars lie in a line; F determines no accelerations there.
  check(n_four_bar(2, 1.2, "index 1"), 5e-9);
}

TEST_CASE("F that jumps and rows with the matching kinks are no alarm") {
  for (const double period : {0.13, 0.7})
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      INFO("period " << period << ", tolerance " << tolerance);
      const auto phase = [period](double t) { return std::fmod(t, 2.0 * period); };
      const Problem saw = ode({0.0, 0.0}, 4.0, [=](double t, const double* y, double* f) {
        f[1] = phase(t) < period ? 1.0 : -1.0;
        f[0] = std::sin(5.0 * t) - y[0] + f[1];
      });
      tp::Constraints tooth;
      tooth.count = 1;
      tooth.value = [=](double t, tp::ConstVector y, tp::Vector g) {
        g[0] = y[1] - std::min(phase(t), 2.0 * period - phase(t));
      };
      const Run run = integrate(saw, tolerance, tooth, {}, false);
      CHECK(run.flag >= 0);
      CHECK(run.status == tp::Status::success);
    }
}

TEST_CASE("a run that collapses for a row that F does not keep ends early, with the row's name") {
  // Three bodies that attract each other in the plane, and the energy that drag takes from them.
  const std::vector<double> mass = {1.0, 0.8, 0.5};
  const auto bodies = [mass](double drag) {
    return ode({1, 0, -0.7, 0.6, -0.5, -0.9, 0.1, 0.6, -0.5, -0.3, 0.7, -0.2}, 20.0,
               [=](double, const double* y, double* f) {
                 for (int i = 0; i < 6; ++i) {
                   f[i] = y[6 + i];
                   f[6 + i] = -drag * y[6 + i];
                 }
                 for (int i = 0; i < 3; ++i)
                   for (int j = 0; j < 3; ++j) {
                     if (i == j) continue;
                     const double dx = y[2 * j] - y[2 * i], dy = y[2 * j + 1] - y[2 * i + 1];
                     const double pull = mass[j] / std::pow(std::hypot(dx, dy), 3);
                     f[6 + 2 * i] += pull * dx;
                     f[7 + 2 * i] += pull * dy;
                   }
               });
  };
  const auto energy_of = [mass](const double* y) {
    double energy = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double *q = y + 2 * i, *v = q + 6;
      energy += mass[i] * (v[0] * v[0] + v[1] * v[1]) / 2.0;
      for (int j = 0; j < i; ++j)
        energy -= mass[i] * mass[j] / std::hypot(q[0] - y[2 * j], q[1] - y[2 * j + 1]);
    }
    return energy;
  };
  tp::Constraints energy;
  energy.count = 1;
  energy.names = {"energy"};
  energy.value = [=, start = energy_of(bodies(0.0).y0.data())](double, tp::ConstVector y,
                                                               tp::Vector g) {
    g[0] = energy_of(y.data()) - start;
  };
  for (const double drag : {1e-3, 1e-4})
    for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
      const Problem problem = bodies(drag);
      const Run run = integrate(problem, tolerance, energy, {}, false);
      INFO("drag " << drag << ", tolerance " << tolerance << ", flag " << run.flag);
      CHECK(contains(run.message, "F does not keep row 0 (energy)"));
      CHECK(run.steps < integrate_plain(problem, tolerance).steps + 1100);
    }
}
