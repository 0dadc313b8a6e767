// Tether: minimum-norm solves where the rank is clear. SPDX-License-Identifier: BSD-3-Clause
#include <limits>

#include "cases.hpp"
#include "support/catch.hpp"
#include "thrown.hpp"

using namespace tether::test;
using tether::linalg::MinimumNorm;

namespace {
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

std::string label(int m, int n) { return std::to_string(m) + " x " + std::to_string(n); }
}  // namespace

TEST_CASE("full rank: equal to a complete orthogonal decomposition") {
  for (const auto& [m, n] : sizes())
    for (unsigned seed = 1; seed <= 5; ++seed) {
      INFO(label(m, n) << ", seed " << seed);
      const Case c = random_case(m, n, seed);
      MinimumNorm solver(m, n);
      load(solver, c.C);
      REQUIRE(solver.factor(c.D.data()));
      REQUIRE(solver.rank() == m);
      CHECK(solver.dropped() == 0);
      const Eigen::VectorXd dy = solve(solver, c.g), expected = oracle(c);
      const double condition = solver.condition();
      CHECK(distance(dy, expected, c.D) <=
            20.0 * n * kEpsilon * condition * condition * length(expected, c.D));
      const Eigen::VectorXd left = c.C * dy - c.g;
      const RowMajor A = c.C * c.D.asDiagonal();
      for (int i = 0; i < m; ++i) {
        CHECK(std::abs(left[i]) <= 10.0 * n * kEpsilon * A.row(i).norm() * length(dy, c.D));
        CHECK(solver.row_norm(i) == Approx(A.row(i).norm()).epsilon(1e-14));
      }
    }
}

TEST_CASE("rows and columns of a wider array: the same bits as the rows by themselves") {
  for (const auto& [m, n] : sizes())
    for (const int gap : {1, 2}) {  // neighbouring columns, and every second one
      INFO(label(m, n) << ", gap " << gap);
      const Case c = random_case(m, n, 7);
      const int width = gap * n + 3;
      RowMajor wide = RowMajor::Constant(2 * m, width, 1e30);  // must not be read
      std::vector<int> rows, columns;
      for (int i = 0; i < m; ++i) rows.push_back(2 * (m - 1 - i));
      for (int j = 0; j < n; ++j) columns.push_back(2 + gap * j);
      for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j)
          wide(rows[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]) = c.C(i, j);
      MinimumNorm part(m, n), whole(m, n);
      load(whole, c.C);
      REQUIRE(whole.factor(c.D.data(), 1e-12));
      std::copy_n(c.D.data(), n, part.metric());
      REQUIRE(part.factor(wide.data(), width, rows.data(), columns.data(), 1e-12));
      CHECK(part.rank() == whole.rank());
      CHECK((solve(part, c.g) - solve(whole, c.g)).cwiseAbs().maxCoeff() == 0.0);

      wide(rows[0], columns[0]) = std::numeric_limits<double>::quiet_NaN();
      CHECK_FALSE(part.factor(wide.data(), width, rows.data(), columns.data(), 1e-12));
    }
}

TEST_CASE("redundant rows: dropped, explained, and the rest still solved") {
  for (const auto& [m, n] : sizes()) {
    if (m < 3) continue;
    INFO(label(m, n));
    Case c = random_case(m, n, 11);
    // Row 1 is a copy of row 0 in other units; the last one a combination of rows 0 and 2.
    c.C.row(1) = -1e3 * c.C.row(0);
    if (m > 3) c.C.row(m - 1) = 0.5 * c.C.row(0) + 2.0 * c.C.row(2);
    const int rank = m > 3 ? m - 2 : m - 1;
    std::mt19937 random(5);
    const Eigen::VectorXd x = c.D.cwiseProduct(random_vector(n, random));
    c.g = c.C * x;

    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    REQUIRE(solver.rank() == rank);
    CHECK(solver.dropped() == m - rank);
    const Eigen::VectorXd dy = solve(solver, c.g);
    CHECK(distance(dy, oracle(c), c.D) <= 1e-9 * length(dy, c.D));
    CHECK(length(dy, c.D) <= length(x, c.D) * (1.0 + 1e-12));

    for (int k = rank; k < m; ++k) {
      CHECK(solver.inconsistency(k) <= 1e-12 * length(x, c.D));
      CHECK(left_of_dependence(c, solver, k) <= 1e-11);
    }
  }
}

TEST_CASE("pivots are a permutation of the rows") {
  for (const auto& [m, n] : sizes()) {
    const Case c = random_case(m, n, 3);
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    std::vector<int> seen(static_cast<std::size_t>(m), 0);
    for (int k = 0; k < m; ++k) ++seen.at(static_cast<std::size_t>(solver.pivot(k)));
    CHECK(seen == std::vector<int>(static_cast<std::size_t>(m), 1));
  }
}

TEST_CASE("a vanished row is dropped and reports its own value") {
  for (const auto& [m, n] : {std::pair<int, int>{4, 6}, {17, 40}}) {
    INFO(label(m, n));
    Case c = random_case(m, n, 21);
    c.C.row(2).setZero();
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    CHECK(solver.rank() == m - 1);
    CHECK(solver.pivot(m - 1) == 2);
    CHECK(solver.row_norm(2) == 0.0);
    c.g[2] = -0.25;
    const Eigen::VectorXd dy = solve(solver, c.g);
    CHECK(solver.inconsistency(m - 1) == 0.25);
    CHECK(distance(dy, oracle(c), c.D) <= 1e-10 * length(dy, c.D));
  }
}

TEST_CASE("nothing but vanished rows: no move") {
  for (const auto& [m, n] : {std::pair<int, int>{2, 3}, {20, 40}}) {
    MinimumNorm solver(m, n);
    load(solver, RowMajor::Zero(m, n));
    const Eigen::VectorXd D = Eigen::VectorXd::Ones(n);
    REQUIRE(solver.factor(D.data()));
    CHECK(solver.rank() == 0);
    CHECK(solve(solver, Eigen::VectorXd::Ones(m)).isZero(0.0));
  }
}

TEST_CASE("components with a zero metric entry do not move") {
  for (const auto& [m, n] : {std::pair<int, int>{2, 5}, {4, 12}, {18, 40}}) {
    INFO(label(m, n));
    Case c = random_case(m, n, 31);
    c.D[1] = c.D[n - 1] = 0.0;
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    CHECK(solver.rank() == m);
    const Eigen::VectorXd dy = solve(solver, c.g);
    CHECK(dy[1] == 0.0);
    CHECK(dy[n - 1] == 0.0);
    CHECK((c.C * dy - c.g).norm() <= 1e-11 * c.g.norm());
    CHECK(distance(dy, oracle(c), c.D) <= 1e-10 * length(dy, c.D));
  }
}

TEST_CASE("an inconsistent right-hand side: distance in the metric, kept rows solved") {
  // x = 0 and x = 1e-6 as 2 x and -5 x + 5e-6, far from the border and beyond it.
  for (const int n : {2, 40}) {
    Case c{RowMajor::Zero(2, n), Eigen::VectorXd::Constant(n, 1e-3), Eigen::VectorXd(2)};
    c.C(0, 0) = 2.0;
    c.C(1, 0) = -5.0;
    c.g << 0.0, 5e-6;
    MinimumNorm solver(2, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    REQUIRE(solver.rank() == 1);
    const Eigen::VectorXd dy = solve(solver, c.g);
    CHECK(solver.inconsistency(1) == Approx(1e-6 / 1e-3).epsilon(1e-12));
    const int kept = solver.pivot(0);
    CHECK(c.C(kept, 0) * dy[0] == Approx(c.g[kept]).margin(1e-18));
  }
}

TEST_CASE("more rows than columns") {
  for (const auto& [m, n] : {std::pair<int, int>{3, 2}, {16, 4}, {20, 3}, {50, 40}}) {
    INFO(label(m, n));
    Case c = random_case(m, n, 41);
    std::mt19937 random(6);
    const Eigen::VectorXd x = c.D.cwiseProduct(random_vector(n, random));
    c.g = c.C * x;
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    REQUIRE(solver.rank() == n);
    CHECK(distance(solve(solver, c.g), x, c.D) <= 1e-9 * length(x, c.D));
    for (int k = n; k < m; ++k) CHECK(solver.inconsistency(k) <= 1e-10 * length(x, c.D));

    const int last = solver.pivot(m - 1);
    const double norm = (c.C.row(last).transpose().cwiseProduct(c.D)).norm();
    c.g[last] += 0.125 * norm;
    solve(solver, c.g);
    CHECK(solver.inconsistency(m - 1) == Approx(0.125).epsilon(1e-8));
  }
}

TEST_CASE("no rows, no columns, and sizes that make no sense") {
  MinimumNorm none(0, 4);
  const Eigen::VectorXd D = Eigen::VectorXd::Ones(4);
  REQUIRE(none.factor(D.data()));
  CHECK(none.rank() == 0);
  Eigen::VectorXd dy = Eigen::VectorXd::Constant(4, 3.0);
  none.solve(nullptr, dy.data());
  CHECK(dy.isZero(0.0));

  MinimumNorm no_columns(2, 0);
  REQUIRE(no_columns.factor(nullptr));
  CHECK(no_columns.rank() == 0);
  CHECK(no_columns.dropped() == 2);

  REQUIRE_THROWS_AS(MinimumNorm(-1, 2), std::invalid_argument);
  CHECK(contains(thrown([] { MinimumNorm(2, -3); }), "columns = -3"));
}

TEST_CASE("fewer rows than the rank: the solution of these rows alone") {
  for (const auto& [m, n] : sizes()) {
    if (m < 3) continue;
    INFO(label(m, n));
    const Case c = random_case(m, n, 17);
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    REQUIRE(solver.rank() == m);
    const Eigen::VectorXd all = solve(solver, c.g);
    for (int k = 1; k < m; ++k)
      CHECK(solver.independent_part(k) <= solver.independent_part(k - 1) * (1.0 + 1e-12));

    const int kept = m - 2;
    Case part = c;
    part.C.resize(kept, n);
    part.g.resize(kept);
    for (int k = 0; k < kept; ++k) {
      part.C.row(k) = c.C.row(solver.pivot(k));
      part.g[k] = c.g[solver.pivot(k)];
    }
    solver.use_rank(kept);
    CHECK(solver.dropped() == 2);
    const Eigen::VectorXd dy = solve(solver, c.g), expected = oracle(part);
    CHECK(distance(dy, expected, c.D) <= 1e-9 * length(expected, c.D));
    // The inconsistency is what is left of a dropped row, as a distance.
    for (int k = kept; k < m; ++k) {
      const int i = solver.pivot(k);
      const double left = std::abs(c.C.row(i).dot(dy) - c.g[i]) / solver.row_norm(i);
      CHECK(solver.inconsistency(k) == Approx(left).epsilon(1e-8).margin(1e-12));
    }
    solver.use_rank(m + 5);  // no more than factor() has kept
    CHECK(solver.rank() == m);
    CHECK((solve(solver, c.g) - all).cwiseAbs().maxCoeff() == 0.0);
  }
}

namespace {

/// `few`: rows of eight entries, and two of them in each row that depends on others.
void compare_kept_with_new_factors(bool few) {
  const int m = 90, n = 80, rank = 60;
  Case c = random_case(m, n, 3);
  for (int i = 0; few && i < m; ++i)
    for (int j = 0; j < n; ++j)
      if ((7 * i + 3 * j) % 10 != 0) c.C(i, j) = 0.0;
  c.D = 2.0 + Eigen::ArrayXd::LinSpaced(n, 0.0, 9.0).sin();
  std::vector<int> rows(m), columns(n);
  for (int i = 0; i < m; ++i) rows[static_cast<std::size_t>(i)] = i;
  for (int j = 0; j < n; ++j) columns[static_cast<std::size_t>(j)] = j;
  std::mt19937 random(8);
  RowMajor share(m - rank, rank);
  for (int j = 0; j < rank; ++j) share.col(j) = random_vector(m - rank, random);
  for (int i = 0; few && i < m - rank; ++i)
    for (int j = 0; j < rank; ++j)
      if (j % 30 != i) share(i, j) = 0.0;
  const auto complete = [&] { c.C.bottomRows(m - rank) = share * c.C.topRows(rank); };
  complete();
  MinimumNorm kept(m, n), anew(m, n);
  const auto factor = [&](MinimumNorm& solver) {
    std::copy_n(c.D.data(), n, solver.metric());
    return solver.factor(c.C.data(), n, rows.data(), columns.data(), 1e-10);
  };
  const auto factor_kept = [&] {
    std::copy_n(c.D.data(), n, kept.metric());
    return kept.factor_kept(c.C.data(), n, rows.data(), columns.data());
  };
  CHECK_FALSE(factor_kept());  // nothing is known yet
  REQUIRE(factor(kept));
  REQUIRE(kept.rank() == rank);

  for (int j = 0; j < n; ++j)
    c.C.col(j) += 0.01 * c.C.col(j).cwiseProduct(random_vector(m, random));
  complete();
  c.g = c.C * c.D.cwiseProduct(random_vector(n, random));
  c.g[m - 1] += 1e-3 * c.C.row(m - 1).norm();
  REQUIRE(factor(anew));
  REQUIRE(factor_kept());
  CHECK(kept.rank() == rank);
  const Eigen::VectorXd dy = solve(kept, c.g);
  const Eigen::VectorXd left = c.C * dy - c.g;
  for (int k = 0; k < rank; ++k) CHECK(std::abs(left[kept.pivot(k)]) <= 1e-9);
  double largest = 0.0;
  for (int k = rank; k < m; ++k) {
    const int i = kept.pivot(k);
    CHECK(kept.inconsistency(k) * kept.row_norm(i) == Approx(std::abs(left[i])).margin(1e-9));
    largest = std::max(largest, kept.inconsistency(k));
  }
  CHECK(largest > 1e-6);
  c.g = c.C * c.D.cwiseProduct(random_vector(n, random));
  const Eigen::VectorXd same = solve(kept, c.g);
  CHECK(distance(same, solve(anew, c.g), c.D) <= 1e-9 * length(same, c.D));

  // Within 1e-4 of it A A^T is still positive definite, and too few digits of it are left.
  const RowMajor independent = c.C;
  c.C.row(kept.pivot(3)) = 2.0 * c.C.row(kept.pivot(1)) + 1e-4 * independent.row(kept.pivot(3));
  CHECK_FALSE(factor_kept());
  c.C = independent;
  REQUIRE(factor(kept));
  REQUIRE(factor_kept());
  c.C.row(kept.pivot(3)) = 2.0 * c.C.row(kept.pivot(1));
  CHECK_FALSE(factor_kept());
  REQUIRE(factor(kept));
  CHECK(kept.rank() >= rank - 1);
  c.C(0, 0) = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(factor_kept());
}

}  // namespace

TEST_CASE("rows known to be independent: as factored anew, until one depends on the others") {
  compare_kept_with_new_factors(false);
}

TEST_CASE("rows of few entries known to be independent: the same") {
  compare_kept_with_new_factors(true);
}

TEST_CASE(
    "rows of few entries in groups: parts of L between the determinant and the angles, late "
    "entries too") {
  const int m = 24, n = 60, groups = 3, width = 2 * n + 1;
  for (const bool adjacent : {true, false}) {
    INFO((adjacent ? "adjacent columns" : "columns with gaps"));
    std::mt19937 random(17);
    Case c{RowMajor::Zero(m, n), random_vector(n, random, 0.5, 2.0), random_vector(m, random)};
    for (int i = 0; i < m; ++i)  // of its group's 20 columns, in which groups take turns
      for (int e = 0; e < 5; ++e)
        c.C(i, groups * ((i / groups + 3 * e * e) % 20) + i % groups) = std::cos(1.0 + 5 * i + e);
    std::vector<int> rows, columns;
    for (int i = 0; i < m; ++i) rows.push_back(i);
    for (int j = 0; j < n; ++j) columns.push_back(adjacent ? 1 + j : 1 + 2 * j);
    RowMajor wide(m, width);
    MinimumNorm solver(m, n);
    std::copy_n(c.D.data(), n, solver.metric());
    const auto spread = [&] {
      wide.setConstant(std::numeric_limits<double>::quiet_NaN());
      for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) wide(i, columns[static_cast<std::size_t>(j)]) = c.C(i, j);
    };
    spread();
    REQUIRE(solver.factor(wide.data(), width, rows.data(), columns.data(), 1e-12));
    REQUIRE(solver.rank() == m);
    const auto check = [&] {
      spread();
      REQUIRE(solver.factor_kept(wide.data(), width, rows.data(), columns.data()));
      RowMajor A = c.C * c.D.asDiagonal();
      for (int k = 0; k < m; ++k) {
        A.row(k) = c.C.row(solver.pivot(k)).cwiseProduct(c.D.transpose());
        A.row(k) /= A.row(k).norm();
      }
      // In whatever order: at least the sine of the angle to all others, and det L is one number.
      const Eigen::MatrixXd gram = A * A.transpose(), inverse = gram.inverse();
      double logarithms = 0.0;
      for (int k = 0; k < m; ++k) {
        const double part = solver.independent_part(k);
        CHECK(part <= 1.0 + 1e-12);
        CHECK(part >= 1.0 / std::sqrt(inverse(k, k)) - 1e-11);
        logarithms += std::log(part);
      }
      CHECK(logarithms == Approx(0.5 * std::log(gram.determinant())).epsilon(1e-10));
      CHECK(distance(solve(solver, c.g), oracle(c), c.D) <= 1e-10 * length(oracle(c), c.D));
    };
    check();
    c.C(5, 0) = 0.7;  // its group has no such column
    check();
    c.C(5, 0) = 0.0;
    check();
    c.C(7, 0) = 0.6;
    spread();  // and is not factored
    c.C(7, 0) = 0.0;
    check();
    c.C(7, 0) = 0.5;
    check();
    for (int j = 0; j < n; ++j) c.C.row(4)[j] += 0.01 * std::sin(1.0 + j);
    check();
  }
}

TEST_CASE("rows known to be independent: lengths whose squares are no numbers") {
  const int m = 20, n = 60;
  Case c = random_case(m, n, 5);
  c.D.setOnes();
  std::vector<int> rows(m), columns(n);
  for (int i = 0; i < m; ++i) rows[static_cast<std::size_t>(i)] = i;
  for (int j = 0; j < n; ++j) columns[static_cast<std::size_t>(j)] = j;
  MinimumNorm kept(m, n), anew(m, n);
  for (MinimumNorm* solver : {&kept, &anew}) std::copy_n(c.D.data(), n, solver->metric());
  REQUIRE(kept.factor(c.C.data(), n, rows.data(), columns.data(), 1e-10));
  for (int i = 0; i < m; ++i) {
    const double unit = i % 3 == 0 ? 1e-200 : i % 3 == 1 ? 1e200 : 1.0;
    c.C.row(i) *= unit;
    c.g[i] *= unit;
  }
  REQUIRE(anew.factor(c.C.data(), n, rows.data(), columns.data(), 1e-10));
  REQUIRE(kept.factor_kept(c.C.data(), n, rows.data(), columns.data()));
  const Eigen::VectorXd same = solve(kept, c.g);
  CHECK(distance(same, solve(anew, c.g), c.D) <= 1e-9 * length(same, c.D));
}

TEST_CASE("few rows known to be independent: as factored anew, every size, until one depends") {
  for (int m = 1; m <= 16; ++m)
    for (int n = m; n <= 32; n += 1 + n / 8) {
      INFO(label(m, n));
      std::mt19937 random(static_cast<unsigned>(40 * m + n));
      Case c = random_case(m, n, static_cast<unsigned>(100 * m + n));
      c.D = c.D.array().pow(0.2);
      // Every second row and column of a wider array; what is between must not be read.
      const int width = 2 * n + 1;
      std::vector<int> rows, columns;
      for (int i = 0; i < m; ++i) rows.push_back(2 * (m - 1 - i));
      for (int j = 0; j < n; ++j) columns.push_back(1 + 2 * j);
      RowMajor wide = RowMajor::Constant(2 * m, width, std::numeric_limits<double>::quiet_NaN());
      const auto entry = [&](int i, int j) -> double& {
        return wide(rows[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]);
      };
      const auto spread = [&] {
        for (int i = 0; i < m; ++i)
          for (int j = 0; j < n; ++j) entry(i, j) = c.C(i, j);
      };
      MinimumNorm solver(m, n);
      const auto kept = [&] {
        return solver.factor_kept(wide.data(), width, rows.data(), columns.data());
      };
      spread();
      CHECK_FALSE(kept());  // nothing is known yet
      std::copy_n(c.D.data(), n, solver.metric());
      REQUIRE(solver.factor(wide.data(), width, rows.data(), columns.data(), 1e-12));
      if (solver.rank() < m || solver.independent_part(m - 1) < 0.02) continue;
      std::vector<int> order;
      for (int k = 0; k < m; ++k) order.push_back(solver.pivot(k));

      // Other rows in their neighbourhood, in other units; another metric.
      c.C += 1e-3 * random_matrix(m, n, random);
      for (int i = 0; i < m; ++i) c.C.row(i) *= std::pow(10.0, 8 * ((i + n) % 3 - 1));
      for (int i = 0; i < m; ++i) c.g[i] *= c.C.row(i).norm();
      c.D = c.D.cwiseProduct(random_vector(n, random, 0.99, 1.01));
      std::copy_n(c.D.data(), n, solver.metric());
      spread();
      REQUIRE(kept());
      CHECK(solver.rank() == m);
      const Eigen::VectorXd dy = solve(solver, c.g), expected = oracle(c);
      const double sine = std::sqrt(solver.least_square());
      CHECK(distance(dy, expected, c.D) <=
            20.0 * n * kEpsilon / (sine * sine) * length(expected, c.D));
      for (int k = 0; k < m; ++k) {
        CHECK(solver.pivot(k) == order[static_cast<std::size_t>(k)]);
        CHECK(solver.independent_part(k) <= 1.0 + 1e-14);
        const Eigen::VectorXd row = c.C.row(k).transpose().cwiseProduct(c.D);
        CHECK(solver.row_norm(k) == Approx(row.norm()).epsilon(1e-14));
      }
      CHECK(solver.condition() <= 1.0 / sine * (1.0 + 1e-12));

      const double whole = entry(m - 1, n - 1);
      for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), 1e200}) {
        entry(m - 1, n - 1) = wrong;
        CHECK_FALSE(kept());
        CHECK_FALSE(kept());  // nor before factor() is called again
        entry(m - 1, n - 1) = whole;
        REQUIRE(solver.factor(wide.data(), width, rows.data(), columns.data(), 1e-12));
      }
      if (m == 1) continue;
      c.C.row(m - 1) = c.C.row(0) + 1e-5 * c.C.row(0).norm() * c.C.row(m - 1).normalized();
      spread();
      CHECK_FALSE(kept());
      REQUIRE(solver.factor(wide.data(), width, rows.data(), columns.data(), 1e-3));
      REQUIRE(solver.rank() == m - 1);
      CHECK_FALSE(kept());  // small systems with dropped rows are factored anew
    }
}
