// Tether: Eigen's decompositions behind functions that are compiled once.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/pivoted_qr.hpp>
#include <tether/linalg/singular_values.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "support/catch.hpp"

using namespace tether::linalg;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Rows (1, 1, 0), (0, 2, 0) and their sum: x_3 is free, the rank is 2, and b = (1, 2, 3) fits.
static MatrixXd of_rank_two() {
  MatrixXd A(3, 3);
  A << 1, 1, 0, 0, 2, 0, 1, 3, 0;
  return A;
}

TEST_CASE("least squares: the shortest solution, of either kind of deficiency") {
  LeastSquares of(1e-12);
  of.factor(of_rank_two());
  CHECK(of.rank() == 2);
  const VectorXd x = of.solve(Eigen::Vector3d(1, 2, 3));
  CHECK((x - Eigen::Vector3d(0, 1, 0)).norm() < 1e-14);
  // No x reaches (1, 1, -1): it is orthogonal to all columns.
  CHECK(VectorXd(of.solve(Eigen::Vector3d(1, 1, -1))).norm() < 1e-14);
  const MatrixXd X = of.solve_columns(of_rank_two());  // A^+ A: onto the rows of A
  CHECK((X - MatrixXd(Eigen::Vector3d(1, 1, 0).asDiagonal())).norm() < 1e-14);
  // A' y = (1, 3, 0) has y = (0, 0, 1) - s (1, 1, -1); the shortest has s = 1/3 of it.
  const VectorXd y = of.solve_transposed(Eigen::Vector3d(1, 3, 0));
  CHECK((y - Eigen::Vector3d(1, 1, 2) / 3).norm() < 1e-14);
  const LeastSquares copy = of;
  of.factor(MatrixXd::Identity(2, 2) * 4);  // of another shape
  CHECK((VectorXd(of.solve(Eigen::Vector2d(4, 8))) - Eigen::Vector2d(1, 2)).norm() < 1e-15);
  CHECK(copy.rank() == 2);
}

TEST_CASE("least squares and pivots: what counts as zero is the caller's choice") {
  const MatrixXd A = Eigen::Vector2d(1, 1e-6).asDiagonal();
  LeastSquares exact, loose(1e-5);
  PivotedQr exact_pivots, loose_pivots(1e-5);
  exact.factor(A);
  loose.factor(A);
  exact_pivots.factor(A);
  loose_pivots.factor(A);
  CHECK(exact.rank() == 2);
  CHECK(loose.rank() == 1);
  CHECK(exact_pivots.rank() == 2);
  CHECK(loose_pivots.rank() == 1);
}

TEST_CASE("pivoted QR: its factors make the columns in the order of the pivots") {
  PivotedQr of(1e-12);
  const MatrixXd A = of_rank_two();
  of.factor(A);
  const std::vector<int> order = of.order();
  CHECK(order == std::vector<int>{1, 0, 2});  // lengths 14^1/2, 2^1/2, 0
  const MatrixXd Q = of.Q(), R = MatrixXd(of.R()).triangularView<Eigen::Upper>();
  CHECK((Q * Q.transpose() - MatrixXd::Identity(3, 3)).norm() < 1e-14);
  for (int k = 0; k < 3; ++k) CHECK((Q * R.col(k) - A.col(order[k])).norm() < 1e-14);
  const MatrixXd none = of.left_null_space();
  REQUIRE(none.cols() == 1);
  CHECK((none.transpose() * A).norm() < 1e-14);
}

TEST_CASE("symmetric eigenvalues and singular values of known matrices") {
  Eigen::Matrix2d two;
  two << 2, 1, 1, 2;
  const SymmetricEigen<2> small = symmetric_eigen(two);
  CHECK(small.converged);
  CHECK((small.values - Eigen::Vector2d(1, 3)).norm() < 1e-15);
  CHECK(std::abs(std::abs(small.vectors.col(1).dot(Eigen::Vector2d(1, 1))) - std::sqrt(2)) < 1e-15);
  // Second differences of n points: 2 - 2 cos(k pi / (n + 1)).
  Eigen::Matrix<double, 6, 6> chain = 2 * Eigen::Matrix<double, 6, 6>::Identity();
  chain.diagonal<1>().setConstant(-1);
  chain.diagonal<-1>().setConstant(-1);
  const Eigen::Matrix<double, 6, 1> values = symmetric_eigenvalues(chain);
  const VectorXd singular = singular_values(chain.topRows(6));
  for (int k = 0; k < 6; ++k) {
    const double exact = 2 - 2 * std::cos((k + 1) * 3.14159265358979323846 / 7);
    CHECK(std::abs(values[k] - exact) < 1e-14);
    CHECK(std::abs(symmetric_eigen(chain).values[k] - exact) < 1e-14);
    CHECK(std::abs(singular[5 - k] - exact) < 1e-14);
  }
  CHECK(singular_values(of_rank_two())[2] < 1e-15);
  Eigen::Matrix3d broken = Eigen::Matrix3d::Identity();
  CHECK((symmetric_eigenvalues(broken) - Eigen::Vector3d::Ones()).norm() == 0);
  broken(1, 0) = broken(0, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(symmetric_eigenvalues(broken)[0] > 0);
}
