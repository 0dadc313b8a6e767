// Tether: many rows, most of them redundant. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <cmath>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// Bodies of nine points that turn about the axis (1, 1, 1) by t + b - b cos t.
template <int kPoints>
struct BodiesOf {
  static constexpr int kEach = 9;

  static std::vector<double> at(double t) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Ones().normalized();
    std::vector<double> y;
    for (int i = 0; i < kPoints; ++i) {
      const Eigen::Vector3d p(std::sin(1.0 + 2.3 * i), std::sin(2.0 + 1.7 * i * i),
                              std::cos(3.0 + 0.9 * i * i));
      const double angle = t + i / kEach * (1.0 - std::cos(t));
      const Eigen::Vector3d turned = Eigen::AngleAxisd(angle, axis) * p;
      y.insert(y.end(), turned.data(), turned.data() + 3);
    }
    return y;
  }

  static Problem problem(double t_end) {
    Problem p = ode(at(0.0), t_end, [](double t, const double* y, double* f) {
      for (int i = 0; i < kPoints; ++i) {
        const double rate = (1.0 + i / kEach * std::sin(t)) / std::sqrt(3.0);
        for (int c = 0; c < 3; ++c)
          f[3 * i + c] = rate * (y[3 * i + (c + 2) % 3] - y[3 * i + (c + 1) % 3]);
      }
    });
    p.reference = at(t_end);
    p.error_components = p.size;
    return p;
  }

  /// All distances, 36 of each body, of which 21 are independent.
  static tp::Constraints distances() {
    tp::Constraints set;
    set.count = kPoints * (kEach - 1) / 2;
    set.value = [start = at(0.0)](double, tp::ConstVector y, tp::Vector g) {
      for_pairs([&](int row, int i, int j) {
        g[row] = 0.0;
        for (int c = 0; c < 3; ++c) {
          const double d = start[static_cast<std::size_t>(3 * i + c)] -
                           start[static_cast<std::size_t>(3 * j + c)];
          g[row] += 0.5 * (std::pow(y[3 * i + c] - y[3 * j + c], 2) - d * d);
        }
      });
    };
    set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
      C.setZero();
      for_pairs([&](int row, int i, int j) {
        for (int c = 0; c < 3; ++c)
          C(row, 3 * j + c) = -(C(row, 3 * i + c) = y[3 * i + c] - y[3 * j + c]);
      });
    });
    return set;
  }

 private:
  template <class Visit>
  static void for_pairs(Visit visit) {
    int row = 0;
    for (int i = 0; i < kPoints; ++i)
      for (int j = i - i % kEach; j < i; ++j) visit(row++, i, j);
  }
};

using Bodies = BodiesOf<27>;  // 108 rows, 63 of them independent

}  // namespace

TEST_CASE("many redundant rows: which ones count is found out a few times in a run") {
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    INFO("tolerance " << tolerance);
    const Problem problem = Bodies::problem(4.0);
    const Run run = integrate(problem, tolerance, Bodies::distances());
    const Run plain = integrate_plain(problem, tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.failures() == 0);
    CHECK(run.statistics.factorizations <= 8);  // also while nothing needs to be moved
    CHECK(run.statistics.jacobian_evaluations <= run.statistics.projections + 20);
    // The polish comes before the move: one move, and one for what it leaves.
    CHECK(run.statistics.iterations <= 2 * run.statistics.projections + 40);
    CHECK(run.drift <= 3e-4 * tolerance);
    CHECK(run.distance <= 0.1 * tp::Options().advanced.tolerance);
    CHECK(run.error <= 1.5 * plain.error);
    CHECK(static_cast<double>(run.steps) <= 1.1 * static_cast<double>(plain.steps));
  }
}

TEST_CASE("many rows: C is zero on entry, after a callback that has failed, too") {
  // Both refuse the 30th and the 60th C; one leaves numbers then in places that it never fills.
  const Problem problem = Bodies::problem(4.0);
  std::vector<Run> runs;
  for (const bool leaves : {false, true}) {
    tp::Constraints set = Bodies::distances();
    const auto whole = std::get<tp::DenseJacobian>(set.jacobian).fill;
    auto zeros = std::make_shared<bool>(true);
    set.jacobian =
        tp::DenseJacobian([=, count = 0](double t, tp::ConstVector y, tp::Matrix C) mutable {
          *zeros = *zeros && C.isZero(0.0);
          if (++count % 30 != 0 || count > 60) return whole(t, y, C);
          if (leaves) C.setConstant(0.1);
          return 1;
        });
    runs.push_back(integrate(problem, 1e-6, set, {}, false));
    REQUIRE(runs.back().flag >= 0);
    CHECK(*zeros);
  }
  CHECK(same_bits(runs[0].y, runs[1].y));
  CHECK(runs[0].statistics.failures() == 2);
}

TEST_CASE("many redundant sparse rows: their factors raise no doubt about C") {
  // 144 rows: too many for the factors of dense ones.
  using Many = BodiesOf<36>;
  const Problem problem = Many::problem(4.0);
  const Run run = integrate(problem, 1e-6, as_sparse(Many::distances(), problem.size), {}, false);
  REQUIRE(run.flag >= 0);
  // Forty checks whether F keeps a row, of twelve evaluations each.
  CHECK(run.statistics.value_evaluations <= run.statistics.iterations + 40 * 12);
  CHECK(run.message.empty());
}

TEST_CASE("many redundant rows: one that becomes independent is found") {
  // 34 points on circles: all circles twice but the last one, which a row asks for from t = 2.
  // Until then only the last row, the area between two points, holds the last point.
  constexpr int kPoints = 34;
  std::vector<double> start;
  for (int i = 0; i < kPoints; ++i)
    start.insert(start.end(), {std::cos(0.1 * i), std::sin(0.1 * i)});
  const Problem problem = ode(start, 6.0, [](double, const double* y, double* f) {
    for (int i = 0; i < kPoints; ++i) {
      f[2 * i] = -y[2 * i + 1];
      f[2 * i + 1] = y[2 * i];
    }
  });
  tp::Constraints set;
  set.count = 2 * kPoints;
  constexpr int kX = 2 * kPoints - 2, kY = kX + 1;
  set.value = [](double t, tp::ConstVector y, tp::Vector g) {
    const auto circle = [&](int i) {
      return 0.5 * (y[2 * i] * y[2 * i] + y[2 * i + 1] * y[2 * i + 1] - 1.0);
    };
    for (int i = 0; i + 1 < kPoints; ++i) {
      g[i] = circle(i);
      g[kPoints + i] = (i + 2.0) * circle(i);
    }
    g[kPoints - 1] = circle(0) + (t > 2.0 ? circle(kPoints - 1) : 0.0);
    g[kY] = y[0] * y[kY] - y[1] * y[kX] - std::sin(0.1 * (kPoints - 1));
  };
  set.jacobian = tp::DenseJacobian([](double t, tp::ConstVector y, tp::Matrix C) {
    C.setZero();
    const auto circle = [&](int row, int i, double factor) {
      for (int k = 2 * i; k < 2 * i + 2; ++k) C(row, k) += factor * y[k];
    };
    for (int i = 0; i + 1 < kPoints; ++i) {
      circle(i, i, 1.0);
      circle(kPoints + i, i, i + 2.0);
    }
    circle(kPoints - 1, 0, 1.0);
    if (t > 2.0) circle(kPoints - 1, kPoints - 1, 1.0);
    C(kY, 0) = y[kY];
    C(kY, 1) = -y[kX];
    C(kY, kX) = -y[1];
    C(kY, kY) = y[0];
  });
  const Run run = integrate(problem, 1e-6, set);
  INFO(run.message);
  REQUIRE(run.flag >= 0);
  CHECK(run.statistics.failures() == 0);
  CHECK(run.distance <= tp::Options().advanced.tolerance);
  CHECK(run.drift <= 1e-10);
  CHECK(run.statistics.factorizations <= run.statistics.projections / 5);
}
