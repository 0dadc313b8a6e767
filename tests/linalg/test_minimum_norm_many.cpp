// Tether: minimum-norm solution of many rows.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>
#include <numeric>

#include "cases.hpp"
#include "linalg/allocations.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using tether::linalg::MinimumNorm;

namespace {

constexpr int kRows = 520, kColumns = 560, kIndependent = 500, kThin = 5;
constexpr double kLittle = 1e-5;

/// Rows of four entries. 500 of them are independent; `thin`: 5 others by 1e-5, 14 are sums of two
/// rows in other units, one vanishes. Shuffled.
Case many_rows(bool thin, double density = 0.0) {
  std::mt19937 random(23);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  Case c{RowMajor::Zero(kRows, kColumns), random_vector(kColumns, random, 0.5, 2.0),
         random_vector(kRows, random)};
  for (int i = 0; i < kIndependent; ++i) {
    c.C(i, i) = 2.0;
    for (const int next : {1, 3, 41}) c.C(i, i + next) = 2.0 * any(random) - 1.0;
    for (int j = 0; density > 0.0 && j < kColumns; ++j)
      if (any(random) < density) c.C(i, j) += 0.02 * (2.0 * any(random) - 1.0);
  }
  for (int i = kIndependent; i + 1 < kRows; ++i) {
    const int one = 7 * (i - kIndependent) + 2;
    c.C.row(i) = 1e3 * c.C.row(one) - 1e2 * c.C.row(one + 200);
    if (thin && i < kIndependent + kThin) c.C(i, 555 - i % 5) += 1e3 * kLittle;
  }
  std::vector<int> order(kRows);
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  const RowMajor C = c.C;
  for (int i = 0; i < kRows; ++i) c.C.row(i) = C.row(order[static_cast<std::size_t>(i)]);
  return c;
}

/// The rows of the first `rank` pivots.
Case of_pivots(const Case& c, const MinimumNorm& solver, int rank) {
  Case part{RowMajor(rank, c.C.cols()), c.D, Eigen::VectorXd(rank)};
  for (int k = 0; k < rank; ++k) {
    part.C.row(k) = c.C.row(solver.pivot(k));
    part.g[k] = c.g[solver.pivot(k)];
  }
  return part;
}

void check_solution(const Case& c, MinimumNorm& solver, double accuracy) {
  const int rank = solver.rank();
  const Eigen::VectorXd dy = solve(solver, c.g), expected = oracle(of_pivots(c, solver, rank));
  CHECK(distance(dy, expected, c.D) <= accuracy * length(expected, c.D));
  for (int k = rank; k < kRows; ++k) {
    const int i = solver.pivot(k);
    const double norm = c.C.row(i).cwiseProduct(c.D.transpose()).norm();
    const double left = std::abs(c.C.row(i).dot(dy) - c.g[i]) / (norm > 0.0 ? norm : 1.0);
    CHECK(solver.inconsistency(k) == Approx(left).epsilon(1e-6).margin(1e-8));
  }
}

}  // namespace

TEST_CASE("many rows: thin, redundant and vanished ones among them") {
  for (const bool thin : {false, true}) {
    INFO((thin ? "with" : "without") << " thin rows");
    const Case c = many_rows(thin);
    MinimumNorm solver(kRows, kColumns);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data(), 1e-10));
    const int rank = kIndependent + (thin ? kThin : 0);
    REQUIRE(solver.rank() == rank);
    std::vector<char> seen(kRows, 0);
    for (int k = 0; k < kRows; ++k) seen[static_cast<std::size_t>(solver.pivot(k))] = 1;
    CHECK(std::count(seen.begin(), seen.end(), 1) == kRows);
    for (int k = 0; k < rank; ++k) {
      const double part = solver.independent_part(k);
      CHECK(part <= 1.0 + 1e-12);
      CHECK((k < kIndependent ? part > 1e-3 : part > 1e-2 * kLittle && part < 1e2 * kLittle));
      if (k > kIndependent) CHECK(part <= solver.independent_part(k - 1));
    }
    CHECK(std::sqrt(solver.least_square()) <= solver.independent_part(rank - 1));
    check_solution(c, solver, thin ? 1e-8 : 1e-11);

    for (int k = rank; k < kRows; ++k) {
      if (solver.row_norm(solver.pivot(k)) == 0.0) continue;
      CHECK(left_of_dependence(c, solver, k) <= 1e-9);
    }

    // Fewer rows, and all again.
    const Eigen::VectorXd all = solve(solver, c.g);
    for (const int fewer : {kIndependent + 2, kIndependent, 300}) {
      solver.use_rank(fewer);
      CHECK(solver.rank() == std::min(fewer, rank));
      check_solution(c, solver, 1e-8);
    }
    solver.use_rank(rank);
    CHECK(solve(solver, c.g) == all);
  }
}

TEST_CASE("many rows that are all independent: few entries, and a third of all") {
  for (const double density : {0.0, 0.3}) {
    INFO("density " << density);
    Case c = many_rows(false, density);
    for (int i = 0; i < kRows; ++i) c.C(i, (i + 1) % kColumns) += 1.0 + i % 3;
    for (int i = 0; i < kRows; ++i) c.C(i, i) += 9.0;
    MinimumNorm solver(kRows, kColumns);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data(), 1e-10));
    REQUIRE(solver.rank() == kRows);
    CHECK(solver.independent_part(kRows - 1) > 1e-3);
    check_solution(c, solver, 1e-10);
    solver.use_rank(200);
    check_solution(c, solver, 1e-10);
  }
}

TEST_CASE("many rows: kept, in wider arrays, without allocation") {
  Case c = many_rows(false);
  std::vector<int> rows(kRows), columns(kColumns);
  std::iota(rows.begin(), rows.end(), 0);
  std::iota(columns.begin(), columns.end(), 1);
  RowMajor wide = RowMajor::Zero(kRows, kColumns + 3);
  wide.middleCols(1, kColumns) = c.C;
  MinimumNorm solver(kRows, kColumns);
  Eigen::VectorXd dy(kColumns);
  const auto factor = [&] {
    std::copy_n(c.D.data(), kColumns, solver.metric());
    return solver.factor(wide.data(), kColumns + 3, rows.data(), columns.data(), 1e-10);
  };
  const auto keep = [&] {
    return solver.factor_kept(wide.data(), kColumns + 3, rows.data(), columns.data());
  };
  REQUIRE(factor());
  REQUIRE(solver.rank() == kIndependent);
  const long before = allocations();
  bool kept = true;
  for (int repeat = 0; repeat < 2; ++repeat) {
    c.D *= 1.5;
    kept = factor() && kept;
    solver.solve(c.g.data(), dy.data());
    c.D[7] *= 1.1;
    std::copy_n(c.D.data(), kColumns, solver.metric());
    kept = keep() && keep() && kept;
    solver.solve(c.g.data(), dy.data());
  }
  CHECK(allocations() == before);
  REQUIRE(kept);
  CHECK(solver.rank() == kIndependent);
  check_solution(c, solver, 1e-10);

  // Rows that are thin are not kept; nor is what is no number.
  const Case thin = many_rows(true);
  wide.middleCols(1, kColumns) = thin.C;
  REQUIRE(factor());
  REQUIRE(solver.rank() == kIndependent + kThin);
  CHECK_FALSE(keep());
  wide(250, 250) = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(factor());
}
