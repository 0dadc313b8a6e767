// Tether: reuse of factors and storage of the minimum-norm solver. SPDX-License-Identifier:
// BSD-3-Clause
#include <utility>

#include "cases.hpp"
#include "linalg/allocations.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using tether::linalg::MinimumNorm;

TEST_CASE("kept factors solve any number of right-hand sides") {
  for (const auto& [m, n] : sizes()) {
    INFO(m << " x " << n);
    Case c = random_case(m, n, 51);
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    const Eigen::VectorXd first = solve(solver, c.g);
    const Eigen::VectorXd second = solve(solver, 2.0 * c.g);
    CHECK(second == 2.0 * first);
    CHECK(solve(solver, c.g) == first);
    // The metric is kept with the factors: the caller's array may change or go.
    Eigen::VectorXd D = c.D;
    load(solver, c.C);
    REQUIRE(solver.factor(D.data()));
    D.setConstant(1e99);
    CHECK(solve(solver, c.g) == first);
  }
}

TEST_CASE("resize to and fro across the border forgets nothing it needs") {
  MinimumNorm solver;
  for (const auto& [m, n] :
       {std::pair<int, int>{3, 5}, {20, 40}, {2, 3}, {16, 32}, {17, 33}, {3, 5}}) {
    INFO(m << " x " << n);
    const Case c = random_case(m, n, 61);
    solver.resize(m, n);
    CHECK(solver.rows() == m);
    CHECK(solver.columns() == n);
    CHECK(solver.rank() == 0);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    CHECK(solver.rank() == m);
    MinimumNorm fresh(m, n);
    load(fresh, c.C);
    REQUIRE(fresh.factor(c.D.data()));
    CHECK(solve(solver, c.g) == solve(fresh, c.g));
  }
}

TEST_CASE("both sides of the border give the same answer") {
  // 16 x 32 is the largest small size; a zero column more is the same problem beyond it.
  const Case c = random_case(16, 32, 71);
  Case wide{RowMajor::Zero(16, 33), Eigen::VectorXd::Ones(33), c.g};
  wide.C.leftCols(32) = c.C;
  wide.D.head(32) = c.D;
  MinimumNorm small(16, 32), large(16, 33);
  load(small, c.C);
  load(large, wide.C);
  REQUIRE(small.factor(c.D.data()));
  REQUIRE(large.factor(wide.D.data()));
  CHECK(small.rank() == large.rank());
  CHECK(distance(solve(small, c.g), solve(large, c.g).head(32), c.D) <=
        1e-11 * length(solve(small, c.g), c.D));
  for (int i = 0; i < 16; ++i) CHECK(small.row_norm(i) == Approx(large.row_norm(i)).epsilon(1e-14));
}

TEST_CASE("a moved solver takes its factors along") {
  for (const auto& [m, n] : {std::pair<int, int>{3, 5}, {20, 40}}) {
    const Case c = random_case(m, n, 81);
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    const Eigen::VectorXd expected = solve(solver, c.g);
    MinimumNorm other(std::move(solver));
    CHECK(solve(other, c.g) == expected);
    MinimumNorm third;
    third = std::move(other);
    CHECK(solve(third, c.g) == expected);
  }
}

TEST_CASE("factor and solve do not allocate") {
  for (const auto& [m, n] : sizes()) {
    INFO(m << " x " << n);
    Case c = random_case(m, n, 91);
    if (m > 2) c.C.row(m - 1) = c.C.row(0);  // a dropped row as well
    Eigen::VectorXd dy(n);
    MinimumNorm solver(m, n);
    const long before = allocations();
    for (int repeat = 0; repeat < 3; ++repeat) {
      load(solver, c.C);
      solver.factor(c.D.data());
      solver.solve(c.g.data(), dy.data());
    }
    CHECK(allocations() == before);
  }
  // The counter works.
  const long before = allocations();
  MinimumNorm solver(20, 40);
  CHECK(allocations() > before);
}
