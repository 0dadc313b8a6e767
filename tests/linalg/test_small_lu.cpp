// Tether: LU factors of small matrices against Eigen's and against the text-book loops.
// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <cmath>
#include <cstring>
#include <random>
#include <tether/linalg/small_lu.hpp>
#include <vector>

#include "support/catch.hpp"

using tether::linalg::SmallLU;

namespace {

Eigen::MatrixXd random_matrix(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(n, n, [&] { return normal(random); });
}

/// P A = L U and A x = b by loops over rows, each entry's operations in the order of the columns.
struct Textbook {
  Eigen::MatrixXd A;
  std::vector<int> row;

  explicit Textbook(Eigen::MatrixXd matrix) : A(std::move(matrix)) {
    const auto n = static_cast<int>(A.rows());
    for (int i = 0; i < n; ++i) row.push_back(i);
    for (int k = 0; k < n; ++k) {
      int l = k;
      for (int i = k + 1; i < n; ++i)
        if (std::abs(A(i, k)) > std::abs(A(l, k))) l = i;
      A.row(k).swap(A.row(l));
      std::swap(row[k], row[l]);
      const volatile double inverse = 1.0 / A(k, k);
      for (int i = k + 1; i < n; ++i) {
        A(i, k) *= inverse;
        for (int j = k + 1; j < n; ++j) {
          const volatile double product = A(k, j) * A(i, k);
          A(i, j) -= product;
        }
      }
    }
  }

  std::vector<double> solve(const Eigen::VectorXd& b) const {
    const auto n = static_cast<int>(A.rows());
    std::vector<double> x(n);
    for (int i = 0; i < n; ++i) {
      x[i] = b[row[i]];
      for (int k = 0; k < i; ++k) {
        const volatile double product = A(i, k) * x[k];
        x[i] -= product;
      }
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int k = n - 1; k > i; --k) {
        const volatile double product = A(i, k) * x[k];
        x[i] -= product;
      }
      x[i] /= A(i, i);
    }
    return x;
  }
};

}  // namespace

TEST_CASE("Factors and solutions of every size have the bits of the text-book loops") {
  for (int n = 1; n <= SmallLU::kLargest; ++n) {
    INFO("n = " << n);
    for (const double scale : {1.0, 1e-150, 1e150}) {
      const Eigen::MatrixXd A = scale * random_matrix(n, static_cast<unsigned>(n));
      const Eigen::VectorXd b = random_matrix(n, 7).col(0);
      Eigen::MatrixXd lu = A;
      SmallLU factors;
      REQUIRE(factors.factor(lu.data(), n) == 0);
      const Textbook expected(A);
      CHECK(std::memcmp(lu.data(), expected.A.data(), sizeof(double) * n * n) == 0);
      bool same_rows = true;
      for (int k = 0; k < n; ++k) same_rows = same_rows && factors.row(k) == expected.row[k];
      CHECK(same_rows);
      std::vector<double> x(n);
      factors.solve(lu.data(), b.data(), x.data());
      CHECK(std::memcmp(x.data(), expected.solve(b).data(), sizeof(double) * n) == 0);
      Eigen::VectorXd in_place = b;
      factors.solve(lu.data(), in_place.data(), in_place.data());
      CHECK(std::memcmp(x.data(), in_place.data(), sizeof(double) * n) == 0);
    }
  }
}

TEST_CASE("Pivots are Eigen's and the rest of a solution is rounding") {
  for (int n = 1; n <= SmallLU::kLargest; ++n) {
    INFO("n = " << n);
    Eigen::MatrixXd A = random_matrix(n, 100U + static_cast<unsigned>(n));
    for (int j = 0; j < n; ++j) A.col(j) *= std::pow(10.0, (j * 7) % 13 - 6);  // graded
    const Eigen::VectorXd b = random_matrix(n, 9).col(0);
    Eigen::MatrixXd lu = A;
    SmallLU factors;
    REQUIRE(factors.factor(lu.data(), n) == 0);
    const Eigen::PartialPivLU<Eigen::MatrixXd> eigen(A);
    bool same = true;
    for (int k = 0; k < n; ++k) same = same && eigen.permutationP().indices()[factors.row(k)] == k;
    CHECK(same);
    Eigen::VectorXd x(n);
    factors.solve(lu.data(), b.data(), x.data());
    const Eigen::VectorXd size = A.cwiseAbs() * x.cwiseAbs() + b.cwiseAbs();
    CHECK((A * x - b).cwiseQuotient(size).cwiseAbs().maxCoeff() < 1e-14 * n);
  }
}

TEST_CASE("A matrix without a pivot is named by the column") {
  SmallLU factors;
  for (const int n : {1, 3, 10, 16, 17, 64}) {
    for (int bad = 0; bad < n; ++bad) {
      Eigen::MatrixXd A = random_matrix(n, 3);
      A.col(bad).setZero();
      CHECK(factors.factor(A.data(), n) == bad + 1);
    }
  }
}
