// Tether: constraints of every rank, consistent or not. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <cmath>
#include <problems/bricard.hpp>
#include <problems/kepler.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

// A heavy top: R' = R hat(w), I w' = I w x w + torque, in the order R by rows, w.
constexpr double kInertia[3] = {1.0, 1.2, 0.5}, kWeight = 2.0;

Problem top() {
  const double tilt = 0.4, c = std::cos(tilt), s = std::sin(tilt);
  return ode({1, 0, 0, 0, c, -s, 0, s, c, 0.3, -0.2, 6}, 5.0,
             [](double, const double* y, double* f) {
               const double *w = y + 9, torque[3] = {kWeight * y[7], -kWeight * y[6], 0.0};
               for (int i = 0; i < 3; ++i) {
                 const int j = (i + 1) % 3, k = (i + 2) % 3;
                 for (int row = 0; row < 9; row += 3)
                   f[row + i] = y[row + j] * w[k] - y[row + k] * w[j];
                 f[9 + i] = ((kInertia[j] - kInertia[k]) * w[j] * w[k] + torque[i]) / kInertia[i];
               }
             });
}

// R'R = 1, RR' = 1, det R = 1, energy, vertical momentum: seven of these fifteen rows depend on
// the others. No derivatives.
tp::Constraints rows_of_top() {
  const auto last = [](const double* y) {
    const Eigen::Map<const Eigen::Vector3d> I(kInertia), vertical(y + 6), w(y + 9);
    return Eigen::Vector2d(w.dot(I.cwiseProduct(w)) / 2 + kWeight * vertical[2],
                           vertical.dot(I.cwiseProduct(w)));
  };
  const Eigen::Vector2d at_start = last(top().y0.data());
  tp::Constraints set;
  set.count = 15;
  set.value = [=](double, tp::ConstVector y, tp::Vector g) {
    const Eigen::Map<const Eigen::Matrix3d> R(y.data());
    const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
    int row = 0;
    for (const Eigen::Matrix3d& product :
         {Eigen::Matrix3d(R.transpose() * R - one), Eigen::Matrix3d(R * R.transpose() - one)})
      for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j) g[row++] = product(i, j);
    g[row] = R.determinant() - 1.0;
    g.tail<2>() = last(y.data()) - at_start;
  };
  return set;
}

/// Two masses of 1 kg on rods of 1 m from (0, 0) and (2, 0), held 2 m apart, in the order q, v,
/// forces; from the position in which all rods lie on the x axis, the masses moving up at `speed`.
struct FourBar {
  static tp::Matrix::PlainObject jacobian(const double* q) {
    tp::Matrix::PlainObject C = tp::Matrix::PlainObject::Zero(3, 4);
    C.row(0) << q[0], q[1], 0.0, 0.0;
    C.row(1) << 0.0, 0.0, q[2] - 2.0, q[3];
    C.row(2) << q[0] - q[2], q[1] - q[3], q[2] - q[0], q[3] - q[1];
    return C;
  }

  /// Rows of velocities in F (index 2), or of accelerations (index 1).
  static Problem problem(double speed, int index) {
    Problem p;
    p.size = 11;
    p.index = index;
    p.t_end = 1.0;
    p.y0 = {1.0, 0.0, 3.0, 0.0, 0.0, speed, 0.0, speed, 0.0, 0.0, 0.0};
    p.yp0 = {0.0, speed, 0.0, speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    p.id = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0};
    p.residual = [index](double, const double* y, const double* yp, double* r) {
      const auto C = jacobian(y);
      const Eigen::Map<const Eigen::Vector4d> v(y + 4), a(yp + 4);
      for (int i = 0; i < 4; ++i) {
        r[i] = yp[i] - y[4 + i];
        r[4 + i] = a[i] + (i % 2 == 1 ? 9.81 : 0.0) + C.col(i).dot(Eigen::Vector3d(y + 8));
      }
      Eigen::Map<Eigen::Vector3d>(r + 8) = index == 2 ? C * v : C * a;
      if (index == 2) return;
      r[8] += v[0] * v[0] + v[1] * v[1];
      r[9] += v[2] * v[2] + v[3] * v[3];
      r[10] += std::pow(v[2] - v[0], 2) + std::pow(v[3] - v[1], 2);
    };
    return p;
  }

  static tp::Constraints lengths() {
    tp::Constraints set;
    set.count = 3;
    set.names = {"left rod", "right rod", "coupler"};
    set.value = [](double, tp::ConstVector q, tp::Vector g) {
      g[0] = 0.5 * (q[0] * q[0] + q[1] * q[1] - 1.0);
      g[1] = 0.5 * (std::pow(q[2] - 2.0, 2) + q[3] * q[3] - 1.0);
      g[2] = 0.5 * (std::pow(q[2] - q[0], 2) + std::pow(q[3] - q[1], 2) - 4.0);
    };
    set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
      C.setZero();
      C.leftCols(4) = jacobian(y.data());
    });
    return set;
  }
};

}  // namespace

TEST_CASE("a start at a dead point is named, whether IDA goes on or not") {
  for (const int index : {1, 2})
    for (const double speed : {0.0, 1.0})
      for (const double tolerance : {1e-4, 1e-6}) {
        INFO("index " << index << ", speed " << speed << ", tolerance " << tolerance);
        const Run run =
            integrate(FourBar::problem(speed, index), tolerance, FourBar::lengths(), {}, false);
        INFO(run.message);
        CHECK(run.status == (run.flag < 0 ? tp::Status::corrector_failed : tp::Status::doubtful));
        if (speed == 0.0) CHECK(run.flag < 0);
        CHECK(run.message.find("y[8], y[9] and y[10]") != std::string::npos);
        CHECK(run.message.find("the rows left rod, right rod and coupler") != std::string::npos);
      }
}

TEST_CASE("full rank: two evaluations, one factorisation for most steps") {
  const Problem problem = pendulum(1.0, 1.0, 30.0, "index 1");
  const Run run = integrate(problem, 1e-6, problem.recommended_constraints());
  REQUIRE(run.flag >= 0);
  CHECK(run.statistics.rank_drops == 0);
  CHECK(run.statistics.failures() == 0);
  CHECK(run.distance <= tp::Options().advanced.tolerance);
  CHECK(run.statistics.factorizations + run.statistics.refactorizations <=
        run.statistics.projections + 15);
  CHECK(static_cast<double>(run.statistics.value_evaluations) <
        2.5 * static_cast<double>(run.statistics.projections));
}

TEST_CASE("redundant rows: the same motion as without them") {
  const Problem problem = pendulum(1.0, 1.0, 30.0, "index 1");
  const tp::Constraints once = problem.recommended_constraints();
  // Length and energy a second time, in other units.
  const tp::Constraints position = problem.select({"position"});
  tp::Constraints copies;
  copies.count = 2;
  copies.value = [](double, tp::ConstVector y, tp::Vector g) {
    g[0] = 1e4 * (y[0] * y[0] + y[1] * y[1] - 1.0);
    g[1] = -1e-3 * ((y[2] * y[2] + y[3] * y[3]) / 2.0 + y[1]);
  };
  copies.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    C(0, 0) = 2e4 * y[0];
    C(0, 1) = 2e4 * y[1];
    C(1, 1) = -1e-3;
    C(1, 2) = -1e-3 * y[2];
    C(1, 3) = -1e-3 * y[3];
  });
  const Run full = integrate(problem, 1e-6, once);
  const Run redundant = integrate(problem, 1e-6, once + copies);
  REQUIRE(redundant.flag >= 0);
  CHECK(redundant.statistics.failures() == 0);
  CHECK(redundant.statistics.rank_drops == redundant.statistics.factorizations);
  CHECK(redundant.distance <= tp::Options().advanced.tolerance);
  CHECK(std::abs(redundant.steps - full.steps) <= 10);
  CHECK(largest_difference(full.y, redundant.y) < 1e-7);
}

TEST_CASE("redundant by differences: fifteen true rows of a top in rotation matrices") {
  const Problem problem = top();
  long steps = 0, plain_steps = 0;
  for (int k = 0; k < 12; ++k) {
    const double tolerance = 1e-10 * std::pow(0.26, k / 11.0);
    const Run run = integrate(problem, tolerance, rows_of_top(), {}, false);
    CAPTURE(tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.failures() == 0);
    CHECK(run.statistics.rank_drops == run.statistics.factorizations);
    CHECK(value(rows_of_top(), problem.t_end, run.y.data(), 12).norm() < 1e-10);
    steps += run.steps;
    plain_steps += integrate_plain(problem, tolerance).steps;
  }
  CHECK(steps < 1.1 * plain_steps);
}

TEST_CASE("redundant everywhere: Kepler's four invariants have rank 3") {
  const Problem problem = kepler(0.6, 50.0);
  const Run run = integrate(problem, 1e-8, problem.recommended_constraints());
  const Run plain = integrate_plain(problem, 1e-8);
  REQUIRE(run.flag >= 0);
  CHECK(run.statistics.rank_drops == run.statistics.factorizations);
  CHECK(run.statistics.failures() == 0);
  CHECK(run.distance <= tp::Options().advanced.tolerance);
  CHECK(run.error < 0.1 * plain.error);
  CHECK(run.steps < 1.2 * static_cast<double>(plain.steps));
}

namespace {

/// The energy E + 1/2 of Kepler's orbits, and a E + b (L - L0), L the angular momentum; without
/// derivatives.
tp::Constraints energy_and_momentum(double a, double b, double L0) {
  tp::Constraints rows;
  rows.count = 2;
  rows.value = [=](double, tp::ConstVector y, tp::Vector g) {
    g[0] = 0.5 * (y[2] * y[2] + y[3] * y[3]) - 1.0 / std::hypot(y[0], y[1]) + 0.5;
    g[1] = a * g[0] + b * (y[0] * y[3] - y[1] * y[2] - L0);
  };
  return rows;
}

}  // namespace

TEST_CASE("almost parallel rows: moves of a thousandth of a tolerance that stay end no run") {
  const double L0 = std::sqrt(1.0 - 0.09);
  const Problem problem = kepler(0.3, 20.0);
  const Run run = integrate(problem, 1e-2, energy_and_momentum(1.0, 1e-4, L0), {}, false);
  INFO(run.message);
  REQUIRE(run.flag >= 0);
  CHECK(run.steps < 100);  // plain IDA: 64
}

TEST_CASE("rows that touch each other: energy and angular momentum of a circular orbit") {
  const Problem problem = kepler(0.0, 20.0);
  const tp::Constraints rows = energy_and_momentum(0.0, 1.0, 1.0);
  for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
    const Run run = integrate(problem, tolerance, rows, {}, false);
    const Run plain = integrate_plain(problem, tolerance);
    INFO("tolerance " << tolerance << ": " << run.message);
    REQUIRE(run.flag >= 0);
    CHECK(static_cast<double>(run.steps) < 1.5 * static_cast<double>(plain.steps));
    const auto error = [](const Run& of) {
      return std::hypot(of.y[0] - std::cos(20.0), of.y[1] - std::sin(20.0));
    };
    CHECK(error(run) < 0.5 * error(plain));
  }
}

TEST_CASE("inconsistent rows: refused at once, by name") {
  for (const double square : {2.0, 1.0 + 1e-3}) {
    INFO("second circle: " << square);
    Host host(circle(10.0), 1e-6);
    host.attach(circle_of(1.0, "unit circle") + circle_of(square, "other circle"));
    CHECK(host.finish() < 0);
    CHECK(host.steps() == 0);
    CHECK(host.projection().status() == tp::Status::inconsistent);
    CHECK(contains(host.projection().message(), "unit circle"));
    CHECK(contains(host.projection().message(), "other circle"));
    CHECK(host.projection().statistics().inconsistent >= 1);
    CHECK(host.projection().statistics().solver_calls <= 20);
  }
}

TEST_CASE("inconsistent rows: only those that contradict are named") {
  const Problem p = ode({1.0, 0.0, 3.0}, 10.0, [](double, const double* y, double* f) {
    f[0] = -y[1];
    f[1] = y[0];
    f[2] = 0.0;
  });
  const tp::Constraints third = row(
      "third stays", [](double, const double* y) { return y[2] - 3.0; },
      [](double, const double*, double* c) { c[2] = 1.0; });
  Host host(p, 1e-6);
  host.attach(circle_of(1.0, "unit circle") + third + circle_of(2.0, "other circle"));
  CHECK(host.finish() < 0);
  CHECK(contains(host.projection().message(), "0 (unit circle)"));
  CHECK(contains(host.projection().message(), "2 (other circle)"));
  CHECK_FALSE(contains(host.projection().message(), "third stays"));
}

TEST_CASE("rows that differ by less than a tolerance are taken as redundant") {
  const Problem problem = circle(10.0);
  const Run run = integrate(
      problem, 1e-6, circle_of(1.0, "unit circle") + circle_of(1.0 + 1e-8, "nearly"), {}, false);
  REQUIRE(run.flag >= 0);
  CHECK(run.statistics.rank_drops > 0);
  CHECK(run.error < 1e-5);
}

TEST_CASE("a row that depends on nothing free to move is refused") {
  tp::Options options;
  options.hold = {true, true};
  Host host(circle(10.0), 1e-6);
  host.attach(on_circle(), options);
  CHECK(host.finish() < 0);
  CHECK(host.projection().status() == tp::Status::inconsistent);
  CHECK(contains(host.projection().message(), "circle"));
}

TEST_CASE("vanishing gradient: (x^2 + y^2 - 1)^2 never divides by nothing") {
  const tp::Constraints squared = row(
      "squared",
      [](double, const double* y) { return std::pow(y[0] * y[0] + y[1] * y[1] - 1.0, 2); },
      [](double, const double* y, double* c) {
        const double r = 4.0 * (y[0] * y[0] + y[1] * y[1] - 1.0);
        c[0] = r * y[0];
        c[1] = r * y[1];
      });
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    INFO("tolerance " << tolerance);
    const Problem problem = circle(20.0);
    const Run run = integrate(problem, tolerance, squared, {}, false);
    const Run plain = integrate_plain(problem, tolerance);
    // Accepted, with moves that only halve the distance, or refused with a reason.
    if (run.flag < 0) {
      CHECK_FALSE(run.message.empty());
    } else {
      CHECK(run.error <= 6.0 * plain.error);
    }
    for (const double x : run.y) CHECK(std::isfinite(x));
    CHECK(run.steps <= 15 * plain.steps);  // repeated small moves are noise to IDA
    CHECK(run.statistics.largest_move < 10.0);
  }
}

TEST_CASE("vanishing gradient: an isolated point and a crossing, where the solution stays") {
  const Problem still = ode({0.0, 0.0, 1.0}, 10.0, [](double, const double* y, double* f) {
    f[0] = -y[0];
    f[1] = -2.0 * y[1];
    f[2] = -0.3 * y[2];
  });
  const tp::Constraints point = row(
      "point", [](double, const double* y) { return y[0] * y[0] + y[1] * y[1]; },
      [](double, const double* y, double* c) {
        c[0] = 2.0 * y[0];
        c[1] = 2.0 * y[1];
      });
  const tp::Constraints crossing = row(
      "crossing", [](double, const double* y) { return y[0] * y[1]; },
      [](double, const double* y, double* c) {
        c[0] = y[1];
        c[1] = y[0];
      });
  for (const tp::Constraints& set : {point, crossing}) {
    const Run run = integrate(still, 1e-6, set, {}, false);
    REQUIRE(run.flag >= 0);
    CHECK(run.y[0] == 0.0);
    CHECK(run.y[1] == 0.0);
    CHECK(std::abs(run.y[2] - std::exp(-3.0)) < 1e-5);
  }
}

TEST_CASE("a vanished gradient with g not zero is named") {
  const tp::Constraints impossible = row(
      "impossible", [](double, const double*) { return 0.5; },
      [](double, const double*, double*) {});
  Host host(circle(10.0), 1e-6);
  host.attach(impossible);
  CHECK(host.finish() < 0);
  CHECK(host.projection().status() == tp::Status::inconsistent);
  CHECK(contains(host.projection().message(), "impossible"));
}

TEST_CASE("close to rest: length and energy rows almost parallel") {
  // A swing of 1e-4 rad: the sine of the angle between the two rows is about 1e-4.
  const double g = 9.80665, start = 1e-4;
  Problem problem = pendulum(1.0, g, 20.0, "index 1");
  problem.y0 = {std::sin(start), -std::cos(start), 0.0, 0.0, g * std::cos(start)};
  problem.yp0 = {0.0, 0.0, -problem.y0[0] * problem.y0[4], -problem.y0[1] * problem.y0[4] - g, 0.0};
  const double frequency = std::sqrt(g) * (1.0 - start * start / 16.0);
  const double angle = start * std::cos(frequency * 20.0);
  problem.reference = {std::sin(angle), -std::cos(angle)};
  problem.error_components = 2;
  const tp::Constraints rows =
      problem.select({"position", "velocity"}) +
      tp::energy([g](tp::ConstVector y) { return (y[2] * y[2] + y[3] * y[3]) / 2.0 + g * y[1]; },
                 [g](tp::ConstVector y, tp::Vector gradient) {
                   gradient[1] = g;
                   gradient[2] = y[2];
                   gradient[3] = y[3];
                 },
                 -g * std::cos(start));
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, rows);
    const Run plain = integrate_plain(problem, tolerance);
    INFO("plain: " << plain.flag << ", " << plain.steps << " steps, error " << plain.error);
    REQUIRE(run.flag >= 0);
    CHECK(run.distance <= 0.1);  // the floor of rounding, amplified by the angle
    CHECK(run.error < 2e-4);     // the swing itself is that large at 1e-6
    CHECK(run.error <= 1e3 * tolerance);
    CHECK(run.steps <= 1.5 * static_cast<double>(plain.steps));
  }
}

TEST_CASE("rows that depend on each other on the set only: Bricard's six-bar linkage") {
  // 49 rows of rank 47 on the set, 48 off it. Kept, the 48th asks for moves that mean nothing: up
  // to 7900 steps, or no way on.
  const struct {
    double tolerance;
    long steps;
  } bounds[] = {{1e-2, 70}, {1e-4, 160}, {1e-6, 280}, {1e-7, 440}, {3e-8, 540}, {1e-8, 630}};
  for (const char* form : {"index 1", "index 2"}) {
    const Problem problem = bricard(5.0, form);
    for (const auto& bound : bounds) {
      INFO(form << ", tolerance " << bound.tolerance);
      const Run run = integrate(problem, bound.tolerance, problem.recommended_constraints());
      REQUIRE(run.flag >= 0);
      CHECK(run.statistics.failures() == 0);
      CHECK(run.steps <= bound.steps);
      CHECK(run.error <= bound.tolerance);
      CHECK(run.distance <= 0.01);
      CHECK(run.statistics.rank_drops == run.statistics.factorizations);
    }
  }
}

TEST_CASE("rank lost at a point of the motion: four-bars through their dead point") {
  // Flat at t = 0.72: there the least independent row magnifies the rounding of g by 1e7.
  const Problem problem = n_four_bar(2, 1.0, "index 0");
  for (const double tolerance : {1e-8, 1e-9, 1.8e-10, 1e-10}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, problem.recommended_constraints());
    REQUIRE(run.flag >= 0);
    CHECK(run.error <= 10.0 * tolerance);
    CHECK(run.statistics.largest_drift_after < 1e-10);
    CHECK(run.steps <= 1000);
  }
}

TEST_CASE("a thin row that asks for more than rounding is not passed over") {
  // From t = 1 on the second row wants z = -97, and nothing else can satisfy it.
  const Problem p = ode({1.0, 0.0, 3.0}, 10.0, [](double, const double* y, double* f) {
    f[0] = -y[1];
    f[1] = y[0];
    f[2] = 0.0;
  });
  const tp::Constraints thin = row(
      "thin",
      [](double t, const double* y) {
        return y[0] * y[0] + y[1] * y[1] - 1.0 + 1e-5 * (y[2] - 3.0) + (t > 1.0 ? 1e-3 : 0.0);
      },
      [](double, const double* y, double* c) {
        c[0] = 2.0 * y[0];
        c[1] = 2.0 * y[1];
        c[2] = 1e-5;
      });
  Host host(p, 1e-6);
  host.attach(circle_of(1.0, "unit circle") + thin);
  int flag = 0;
  for (int k = 0; k < 500 && flag >= 0; ++k) flag = host.step();
  CHECK(host.t <= 1.0);
  CHECK(host.t > 0.99);  // and the thin row did no harm before
  CHECK(host.projection().statistics().failures() > 0);
}
