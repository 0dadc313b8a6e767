// Tether: minimum-norm solves with many sparse rows and few full ones. SPDX-License-Identifier:
// BSD-3-Clause
#include <limits>

#include "allocations.hpp"
#include "cases.hpp"
#include "support/catch.hpp"
#include "thrown.hpp"

using namespace tether::test;
using tether::linalg::SparseMinimumNorm;

namespace {

/// Sparse rows first, then `full` full ones.
struct SparseCase {
  Case dense;
  std::vector<int> starts{0}, columns;
  int full = 0;
};

/// Row i has entries near column 1.4 i and one anywhere.
SparseCase banded(int sparse, int full, unsigned seed) {
  const int n = 3 * sparse / 2 + 4;
  SparseCase c{random_case(sparse + full, n, seed), {0}, {}, full};
  std::mt19937 random(seed + 100);
  for (int i = 0; i < sparse; ++i) {
    const int stray = std::uniform_int_distribution<int>(0, n - 1)(random);
    for (int j = 0; j < n; ++j) {
      if (std::abs(j - 7 * i / 5 - 1) <= 2 || j == stray)
        c.columns.push_back(j);
      else
        c.dense.C(i, j) = 0.0;
    }
    c.starts.push_back(static_cast<int>(c.columns.size()));
  }
  return c;
}

void load(SparseMinimumNorm& solver, const SparseCase& c) {
  const int sparse = solver.sparse_rows();
  for (int i = 0; i < sparse; ++i)
    for (int e = c.starts[static_cast<std::size_t>(i)];
         e < c.starts[static_cast<std::size_t>(i) + 1]; ++e)
      solver.entries()[e] = c.dense.C(i, c.columns[static_cast<std::size_t>(e)]);
  for (int f = 0; f < c.full; ++f)
    for (int j = 0; j < solver.columns(); ++j) solver.full_row(f)[j] = c.dense.C(sparse + f, j);
  std::copy_n(c.dense.D.data(), solver.columns(), solver.metric());
}

SparseMinimumNorm factored(const SparseCase& c) {
  SparseMinimumNorm solver;
  solver.resize(static_cast<int>(c.dense.C.cols()), c.starts, c.columns, c.full);
  load(solver, c);
  REQUIRE(solver.factor());
  return solver;
}

Eigen::VectorXd solve(SparseMinimumNorm& solver, const Eigen::VectorXd& g) {
  Eigen::VectorXd dy(solver.columns());
  solver.solve(g.data(), dy.data());
  return dy;
}

}  // namespace

TEST_CASE("sparse and full rows: equal to a complete orthogonal decomposition") {
  for (const auto& [sparse, full] :
       {std::make_pair(1, 0), {0, 1}, {5, 0}, {40, 1}, {40, 3}, {150, 2}})
    for (unsigned seed = 1; seed <= 4; ++seed) {
      INFO(sparse << " sparse, " << full << " full, seed " << seed);
      const SparseCase c = banded(sparse, full, seed);
      SparseMinimumNorm solver = factored(c);
      CHECK(solver.rank() == sparse + full);
      const Eigen::VectorXd dy = solve(solver, c.dense.g), expected = oracle(c.dense);
      const RowMajor A = c.dense.C * c.dense.D.asDiagonal();
      const RowMajor unit = A.rowwise().norm().cwiseInverse().asDiagonal() * A;
      const Eigen::VectorXd singular = unit.jacobiSvd().singularValues();
      const double condition = singular.maxCoeff() / singular.minCoeff();
      CHECK(length(dy - expected, c.dense.D) <=
            1e-14 * condition * condition * length(expected, c.dense.D));
    }
}

TEST_CASE("redundant sparse and full rows: dropped, explained, the rest still solved") {
  SparseCase c = banded(30, 2, 9);
  c.dense.D.setOnes();
  // Row 12 repeats the pattern and the direction of row 11; full row 31 adds rows 3 and 30.
  for (int i = 12; i < 13; ++i) {
    const int begin = c.starts[11], end = c.starts[12];
    c.columns.erase(c.columns.begin() + c.starts[12], c.columns.begin() + c.starts[13]);
    const std::vector<int> copy(c.columns.begin() + begin, c.columns.begin() + end);
    c.columns.insert(c.columns.begin() + end, copy.begin(), copy.end());
    const int change = 2 * end - begin - c.starts[13];
    for (std::size_t k = 13; k < c.starts.size(); ++k) c.starts[k] += change;
  }
  c.dense.C.row(12) = -1e5 * c.dense.C.row(11);
  c.dense.C.row(31) = 2.0 * c.dense.C.row(30) - 0.5 * c.dense.C.row(3);
  std::mt19937 random(3);
  c.dense.g = c.dense.C * random_vector(static_cast<int>(c.dense.C.cols()), random);
  SparseMinimumNorm solver = factored(c);
  REQUIRE(solver.rank() == 30);
  CHECK((solver.pivot(30) == 11 || solver.pivot(30) == 12));
  CHECK(solver.pivot(31) == 31);
  const Eigen::VectorXd dy = solve(solver, c.dense.g);
  CHECK(length(dy - oracle(c.dense), c.dense.D) <= 1e-9 * length(dy, c.dense.D));
  for (const int k : {30, 31}) CHECK(solver.inconsistency(k) < 1e-9);

  // The shares of the kept rows (scaled to unit length) give the dropped one.
  for (const int k : {30, 31}) {
    const std::vector<double> share = solver.dependence(k);
    const int row = solver.pivot(k);
    Eigen::VectorXd rest = c.dense.C.row(row).transpose() / c.dense.C.row(row).norm();
    for (int i = 0; i < 30; ++i) {
      const auto kept = c.dense.C.row(solver.pivot(i));
      rest -= share[static_cast<std::size_t>(i)] * kept.transpose() / kept.norm();
    }
    CHECK(rest.norm() < 1e-9);
  }
  // What contradicts is told as a distance.
  const int row = solver.pivot(31);
  c.dense.g[row] += 0.25 * solver.row_norm(row);
  solve(solver, c.dense.g);
  CHECK(solver.inconsistency(31) == Approx(0.25).epsilon(1e-8));
}

TEST_CASE("vanishing rows, held columns, huge and tiny units, entries that are not finite") {
  SparseCase c = banded(20, 1, 4);
  SparseMinimumNorm solver = factored(c);
  const Eigen::VectorXd plain = solve(solver, c.dense.g);

  SparseCase scaled = c;  // the units of a row do not matter
  scaled.dense.C.row(2) *= 1e200;
  scaled.dense.g[2] *= 1e200;
  scaled.dense.C.row(7) *= 1e-200;
  scaled.dense.g[7] *= 1e-200;
  solver = factored(scaled);
  CHECK(length(solve(solver, scaled.dense.g) - plain, c.dense.D) <=
        1e-10 * length(plain, c.dense.D));

  SparseCase zero = c;
  zero.dense.C.row(5).setZero();
  solver = factored(zero);
  REQUIRE(solver.rank() == 20);
  CHECK(solver.pivot(20) == 5);
  CHECK(solver.row_norm(5) == 0.0);
  solve(solver, zero.dense.g);
  CHECK(solver.inconsistency(20) == std::abs(zero.dense.g[5]));

  SparseCase held = c;
  held.dense.D[9] = 0.0;
  solver = factored(held);
  CHECK(solve(solver, held.dense.g)[9] == 0.0);

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    load(solver, c);
    solver.entries()[3] = bad;
    CHECK_FALSE(solver.factor());
    load(solver, c);
    solver.full_row(0)[3] = bad;
    CHECK_FALSE(solver.factor());
  }
  load(solver, c);  // and recovers
  REQUIRE(solver.factor());
  CHECK((solve(solver, c.dense.g) - plain).cwiseAbs().maxCoeff() == 0.0);
}

TEST_CASE("a long band: little fill, no allocation once resized") {
  const SparseCase c = banded(400, 1, 2);
  SparseMinimumNorm solver = factored(c);
  Eigen::VectorXd dy = solve(solver, c.dense.g);
  load(solver, c);
  const long before = allocations();
  REQUIRE(solver.factor());
  solver.solve(c.dense.g.data(), dy.data());
  CHECK(allocations() == before);
}

TEST_CASE("patterns that make no sense are refused") {
  SparseMinimumNorm solver;
  const auto refusal = [&](int n, std::vector<int> starts, std::vector<int> columns) {
    return thrown([&] { solver.resize(n, starts, columns, 0); });
  };
  CHECK(refusal(3, {0, 2}, {0, 2}).empty());
  CHECK(contains(refusal(3, {}, {}), "starts"));
  CHECK(contains(refusal(3, {0, 3}, {0, 2}), "starts"));
  CHECK(contains(refusal(3, {0, 2, 1}, {0}), "starts"));
  CHECK(contains(refusal(3, {0, 2}, {2, 0}), "ascend"));
  CHECK(contains(refusal(3, {0, 2}, {1, 3}), "row 0"));
}
