// Tether: levels of columns, and when another metric is tried. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <nvector/nvector_serial.h>

#include "host.hpp"
#include "movers/rows_at.hpp"
#include "rows/row_levels.hpp"
#include "step/metric_choice.hpp"
#include "support/catch.hpp"

using namespace tether::ida_projection;

namespace {

using Rows = std::vector<std::vector<int>>;

std::vector<int> levels(const Rows& rows, int n) {
  RowPattern pattern;
  pattern.n = n;
  for (const std::vector<int>& row : rows) {
    pattern.columns.insert(pattern.columns.end(), row.begin(), row.end());
    pattern.starts.push_back(static_cast<int>(pattern.columns.size()));
  }
  return levels_of_columns(pattern);
}

/// Points on circles of radius 1 with speed 1, y = (q, v): the lengths, their rates, and the sum of
/// all x if wanted.
Constraints rows_of_points(int points, bool with_sum, double sum) {
  Constraints set;
  set.count = 2 * points + (with_sum ? 1 : 0);
  set.value = [=](double, ConstVector y, Vector g) {
    for (int i = 0; i < points; ++i) {
      const auto q = y.segment<2>(2 * i), v = y.segment<2>(2 * points + 2 * i);
      g[i] = 0.5 * (q.dot(q) - 1.0);
      g[points + i] = q.dot(v);
    }
    for (int i = 0; with_sum && i < points; ++i)
      g[2 * points] = (i == 0 ? -sum : g[2 * points]) + y[2 * i];
  };
  set.jacobian = DenseJacobian{[=](double, ConstVector y, Matrix C) {
    C.setZero();
    for (int i = 0; i < points; ++i) {
      const auto q = y.segment<2>(2 * i), v = y.segment<2>(2 * points + 2 * i);
      C.block<1, 2>(i, 2 * i) = C.block<1, 2>(points + i, 2 * points + 2 * i) = q.transpose();
      C.block<1, 2>(points + i, 2 * i) = v.transpose();
      if (with_sum) C(2 * points, 2 * i) = 1.0;
    }
  }};
  return set;
}

/// IDA's vectors at points on circles, whose rates are wrong by 1e-6, after a correction of 1e-4 of
/// positions and of 1e-8 of velocities.
class PointsOnCircles {
 public:
  explicit PointsOnCircles(int points)
      : n(4 * points),
        base_(N_VNew_Serial(n, context_)),
        correction_(N_VClone(base_)),
        weights_(N_VClone(base_)) {
    std::vector<double> y, v;
    for (int i = 0; i < points; ++i) {
      const double angle = 0.2 + 0.3 * i, wrong = 1e-6;
      sum += std::cos(angle);
      y.insert(y.end(), {std::cos(angle), std::sin(angle)});
      v.insert(v.end(), {-std::sin(angle) + wrong * std::cos(angle),
                         std::cos(angle) + wrong * std::sin(angle)});
    }
    rate_ = v;
    rate_.resize(static_cast<std::size_t>(n), 0.0);
    y.insert(y.end(), v.begin(), v.end());
    N_VConst(1e4, weights_);
    for (int i = 0; i < n; ++i) {
      NV_Ith_S(correction_, i) = i < 2 * points ? 1e-4 : 1e-8;
      NV_Ith_S(base_, i) = y[static_cast<std::size_t>(i)] - NV_Ith_S(correction_, i);
    }
  }
  ~PointsOnCircles() {
    for (N_Vector used : {base_, correction_, weights_}) N_VDestroy(used);
  }
  PointsOnCircles(const PointsOnCircles&) = delete;
  PointsOnCircles& operator=(const PointsOnCircles&) = delete;

  Candidate candidate(double h) {
    Candidate made{0.0, base_, correction_, weights_};
    made.with_entries();
    made.h = h;
    made.predicted_rate = rate_.data();
    return made;
  }

  int n;
  double sum = 0.0;  // of all x

 private:
  tether::test::Context context_;
  N_Vector base_, correction_, weights_;
  std::vector<double> rate_;
};

/// The largest part of any position in the move.
double slide(int points, double h, bool with_sum = false) {
  PointsOnCircles at(points);
  const Constraints rows = rows_of_points(points, with_sum, at.sum);
  Options options;
  options.advanced.metric = Metric::local_correction;
  Statistics statistics;
  const auto mover = make_contiguous_rows(rows, options, statistics, at.n, false);
  const Candidate candidate = at.candidate(h);
  REQUIRE(mover->set_algebraic(candidate, nullptr, {}) == Status::success);
  REQUIRE(mover->move(candidate).status == Status::success);
  CHECK(mover->remaining_drift(candidate) <= 1e-12);
  double largest = 0.0;
  for (int i = 0; i < 2 * points; ++i)
    largest = std::max(largest, std::abs(candidate.correction_entries[i] - 1e-4));
  return largest;
}

/// Solutions until a move that is not allowed to converge is not explained by rounding either.
long solutions_of_failure(int points, bool sparse) {
  PointsOnCircles at(points);
  const Constraints dense = rows_of_points(points, false, 0.0);
  const Constraints rows = sparse ? tether::test::as_sparse(dense, at.n) : dense;
  Options options;
  options.advanced.metric = Metric::error_weights;
  options.advanced.maximum_iterations = 1;
  options.advanced.tolerance = 1e-12;
  Statistics statistics;
  const auto mover = make_contiguous_rows(rows, options, statistics, at.n, sparse);
  const Candidate candidate = at.candidate(1e-4);
  REQUIRE(mover->set_algebraic(candidate, nullptr, {}) == Status::success);
  REQUIRE(mover->move(candidate).status == Status::not_converged);
  return statistics.iterations;
}

/// Radial rate of the first point after a move and what finishes it, where the rows of three such
/// rates a, b, c are a + b, b + c and a - c + 1e-6 (a + c). Positions are moved so little that
/// their rounding is all that solutions of many rows see.
double rate_by_nearly_dependent_rows(int points) {
  PointsOnCircles at(points);
  Constraints rows = rows_of_points(points, false, 0.0);
  const Eigen::Matrix3d mix =
      (Eigen::Matrix3d() << 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0 + 1e-6, 0.0, -1.0 + 1e-6).finished();
  rows.value = [points, mix, value = rows.value](double t, ConstVector y, Vector g) {
    const int flag = value(t, y, g);
    g.segment<3>(points) = (mix * g.segment<3>(points)).eval();
    return flag;
  };
  const auto fill = std::get<DenseJacobian>(rows.jacobian).fill;
  rows.jacobian = DenseJacobian{[points, mix, fill](double t, ConstVector y, Matrix C) {
    const int flag = fill(t, y, C);
    C.middleRows<3>(points) = (mix * C.middleRows<3>(points)).eval();
    return flag;
  }};
  const Constraints sparse = tether::test::as_sparse(rows, at.n);
  Options options;
  options.advanced.metric = Metric::local_correction;
  options.advanced.tolerance = 1e-6;
  Statistics statistics;
  const auto mover = make_contiguous_rows(sparse, options, statistics, at.n, true);
  const Candidate candidate = at.candidate(1e-12);
  REQUIRE(mover->set_algebraic(candidate, nullptr, {}) == Status::success);
  REQUIRE(mover->move(candidate).status == Status::success);
  const auto y = [&](int i) { return candidate.base_entries[i] + candidate.correction_entries[i]; };
  return std::abs(y(0) * y(2 * points) + y(1) * y(2 * points + 1));
}

}  // namespace

TEST_CASE("levels: positions, velocities and accelerations of a chain, whatever stands between") {
  // Points 0 .. 3 have q = 3 i, v = 3 i + 1, a = 3 i + 2; rods between neighbours, and an energy.
  Rows rows;
  for (int level = 2; level >= 0; --level)  // the longest first
    for (int i = 0; i < 3; ++i) {
      std::vector<int> row;
      for (int point = i; point <= i + 1; ++point)
        for (int k = 0; k <= level; ++k) row.push_back(3 * point + k);
      rows.push_back(row);
    }
  rows.push_back({0, 1, 3, 4, 6, 7, 9, 10});
  CHECK(levels(rows, 14) == std::vector<int>{0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, -1, -1});
}

TEST_CASE("levels: rows none of which holds another one have one level") {
  CHECK(levels({{0, 1}, {1, 2}, {2, 3}, {0, 1}}, 4) == std::vector<int>(4, 0));
  CHECK(levels({{}, {0, 2}}, 3) == std::vector<int>{0, -1, 0});
  CHECK(levels({}, 2) == std::vector<int>{-1, -1});
}

TEST_CASE("choice of the metric: looks seldom where nothing was found") {
  MetricChoice choice;
  int looks = 0;
  for (int move = 0; move < 80; ++move)
    if (choice.due()) {
      ++looks;
      CHECK_FALSE(choice.doubts({0.1, 1e-3}));
    }
  CHECK(looks == 10);
}

TEST_CASE("choice of the metric: the other one is taken where it halves the move and its answer") {
  MetricChoice choice;
  const MoveAndResponse stiff{0.1, 0.05};
  CHECK_FALSE(MetricChoice().doubts({1e-5, 9e-5}));  // harms nobody
  REQUIRE(choice.doubts(stiff));
  CHECK_FALSE(choice.prefers({0.08, 0.0}, stiff));
  CHECK_FALSE(choice.by_levels());
  CHECK_FALSE(choice.doubts(stiff));  // not at once again
  REQUIRE(choice.doubts(stiff));
  CHECK(choice.prefers({0.05, 0.01}, stiff));
  CHECK(choice.by_levels());
  REQUIRE(choice.due());
  REQUIRE(choice.doubts(stiff));
  CHECK(choice.prefers({0.01, 0.001}, stiff));
  CHECK_FALSE(choice.by_levels());
}

TEST_CASE("scales: positions move at most h times as far as velocities") {
  // Corrections alone would have the points slide along by what their rates are wrong.
  CHECK(slide(20, 1e-4) <= 1e-8);
  CHECK(slide(20, 1e-2) <= 1e-8);
  CHECK(slide(8, 1e-4) <= 1e-8);
  CHECK(slide(20, 1e6) >= 1e-7);         // h times the velocities' scales are the larger ones
  CHECK(slide(20, 0.0) >= 1e-7);         // there is no step
  CHECK(slide(20, 1e-4, true) >= 1e-7);  // a row of positions has none of rates beside it
}

TEST_CASE("what rounding of g may ask for takes few solutions, however many the rows") {
  CHECK(solutions_of_failure(10, false) <= 6);
  CHECK(solutions_of_failure(60, false) <= 6);
  CHECK(solutions_of_failure(25, true) <= 6);
  CHECK(solutions_of_failure(100, true) <= 12);
}

TEST_CASE("rows that nearly depend on others are followed, however little of g they are") {
  // At first it is wrong by 1e-6. One solution takes a third of that.
  CHECK(rate_by_nearly_dependent_rows(100) <= 1e-10);
}
