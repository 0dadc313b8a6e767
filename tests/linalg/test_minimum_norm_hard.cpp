// Tether: minimum-norm solves at the limits of double precision. SPDX-License-Identifier:
// BSD-3-Clause
#include <limits>

#include "cases.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using tether::linalg::MinimumNorm;

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

const std::vector<std::pair<int, int>> kBothPaths = {{3, 5}, {13, 14}, {20, 36}};

Eigen::VectorXd solve_case(const Case& c, MinimumNorm& solver) {
  load(solver, c.C);
  REQUIRE(solver.factor(c.D.data()));
  return solve(solver, c.g);
}

}  // namespace

TEST_CASE("near rank loss: backward stable up to condition 1e12") {
  for (const auto& [m, n] : kBothPaths)
    for (const double gap : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 5e-12}) {
      INFO(m << " x " << n << ", gap " << gap);
      Case c = random_case(m, n, 7);
      c.D.setOnes();
      std::mt19937 random(8);
      // The last row differs from a combination of two others by `gap`, orthogonally to all.
      Eigen::VectorXd across = random_vector(n, random);
      const RowMajor others = c.C.topRows(m - 1);
      across -= others.transpose() * (others * others.transpose()).ldlt().solve(others * across);
      across.normalize();
      c.C.row(m - 1) = c.C.row(0) + c.C.row(1);
      c.C.row(m - 1) += gap * c.C.row(m - 1).norm() * across.transpose();
      const Eigen::VectorXd x = c.C.transpose() * random_vector(m, random);
      c.g = c.C * x;

      MinimumNorm solver(m, n);
      const Eigen::VectorXd dy = solve_case(c, solver);
      REQUIRE(solver.rank() == m);
      // The estimate is the size of the smallest pivot, within what m x n pivoting may hide.
      CHECK(solver.condition() > 0.2 / gap);
      CHECK(solver.condition() < 100.0 * m / gap);
      // Residuals at round-off whatever the condition; the error grows with 1 / gap, no faster.
      const Eigen::VectorXd left = c.C * dy - c.g;
      for (int i = 0; i < m; ++i)
        CHECK(std::abs(left[i]) <= 20.0 * n * kEpsilon * c.C.row(i).norm() * dy.norm());
      CHECK((dy - x).norm() <= 200.0 * n * kEpsilon / gap * x.norm());
    }
}

TEST_CASE("below the rank tolerance a row counts as redundant") {
  for (const auto& [m, n] : kBothPaths) {
    Case c = random_case(m, n, 9);
    c.D.setOnes();
    c.C.row(m - 1) = c.C.row(0);
    c.C(m - 1, n - 1) += 1e-9;
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    CHECK(solver.rank() == m);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data(), 1e-6));
    CHECK(solver.rank() == m - 1);
  }
}

TEST_CASE("units of the rows do not matter: 1e-200 to 1e200") {
  for (const auto& [m, n] : kBothPaths) {
    INFO(m << " x " << n);
    const Case c = random_case(m, n, 13);
    MinimumNorm solver(m, n);
    const Eigen::VectorXd expected = solve_case(c, solver);
    const double condition = solver.condition();
    for (const double exponent : {-200.0, -140.0, -3.0, 140.0, 200.0}) {
      INFO("unit 1e" << exponent);
      Case scaled = c;
      for (int i = 0; i < m; i += 2) {
        const double unit = std::pow(10.0, i % 4 == 0 ? exponent : -exponent);
        scaled.C.row(i) *= unit;
        scaled.g[i] *= unit;
      }
      const Eigen::VectorXd dy = solve_case(scaled, solver);
      CHECK(solver.rank() == m);
      CHECK(distance(dy, expected, c.D) <=
            100.0 * kEpsilon * condition * condition * length(expected, c.D));
    }
  }
}

TEST_CASE("units of the unknowns do not matter: D and C in any units of y") {
  for (const auto& [m, n] : kBothPaths) {
    INFO(m << " x " << n);
    const Case c = random_case(m, n, 17);
    MinimumNorm solver(m, n);
    const Eigen::VectorXd expected = solve_case(c, solver);
    const double condition = solver.condition();
    Case scaled = c;
    Eigen::VectorXd unit(n);
    for (int j = 0; j < n; ++j) unit[j] = std::pow(10.0, 50.0 * (j % 5 - 2));
    scaled.D = c.D.cwiseProduct(unit);
    scaled.C = c.C * unit.cwiseInverse().asDiagonal();
    const Eigen::VectorXd dy = solve_case(scaled, solver).cwiseQuotient(unit);
    CHECK(distance(dy, expected, c.D) <=
          100.0 * kEpsilon * condition * condition * length(expected, c.D));
    // Powers of two change no digit at all.
    for (int j = 0; j < n; ++j) unit[j] = std::ldexp(1.0, 3 * (j % 7 - 3));
    scaled.D = c.D.cwiseProduct(unit);
    scaled.C = c.C * unit.cwiseInverse().asDiagonal();
    CHECK(solve_case(scaled, solver).cwiseQuotient(unit) == expected);
  }
}

TEST_CASE("scaling the whole metric leaves the solution") {
  for (const auto& [m, n] : kBothPaths) {
    const Case c = random_case(m, n, 19);
    MinimumNorm solver(m, n);
    const Eigen::VectorXd expected = solve_case(c, solver);
    for (const double factor : {1e-160, 1e-12, 1e9, 1e160}) {
      INFO(m << " x " << n << ", D times " << factor);
      Case scaled = c;
      scaled.D *= factor;
      const Eigen::VectorXd dy = solve_case(scaled, solver);
      CHECK(solver.rank() == m);
      const double condition = solver.condition();
      CHECK(distance(dy, expected, c.D) <=
            100.0 * kEpsilon * condition * condition * length(expected, c.D));
    }
  }
}

TEST_CASE("NaN and infinity are noticed wherever they are") {
  for (const auto& [m, n] : kBothPaths)
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity})
      for (const auto& [i, j] : {std::pair<int, int>{0, 0}, {m - 1, n - 1}, {m / 2, 1}}) {
        INFO(m << " x " << n << ": " << bad << " at " << i << ", " << j);
        Case c = random_case(m, n, 23);
        MinimumNorm solver(m, n);
        c.C(i, j) = bad;
        load(solver, c.C);
        CHECK_FALSE(solver.factor(c.D.data()));
        // The next factorisation is not spoilt by it.
        c.C(i, j) = 0.5;
        load(solver, c.C);
        CHECK(solver.factor(c.D.data()));
        CHECK(solve(solver, c.g).allFinite());
      }
  Case c = random_case(2, 3, 29);
  c.D[1] = std::numeric_limits<double>::quiet_NaN();
  MinimumNorm solver(2, 3);
  load(solver, c.C);
  CHECK_FALSE(solver.factor(c.D.data()));
}

TEST_CASE("rows of wildly different length in one set") {
  // |row| from 1e-9 to 1e9, two of them parallel up to units: the rank must not depend on that.
  for (const auto& [m, n] : kBothPaths) {
    Case c = random_case(m, n, 37);
    for (int i = 0; i < m; ++i) c.C.row(i) *= std::pow(10.0, 18.0 * i / (m - 1) - 9.0);
    MinimumNorm solver(m, n);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    CHECK(solver.rank() == m);
    c.C.row(0) = 1e-12 * c.C.row(m - 1);
    load(solver, c.C);
    REQUIRE(solver.factor(c.D.data()));
    CHECK(solver.rank() == m - 1);
  }
}
