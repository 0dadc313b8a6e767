// Tether: eigenvalues of small symmetric matrices. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Eigenvalues>
#include <limits>
#include <tether/linalg/symmetric_eigen.hpp>

namespace tether::linalg::detail {

namespace {

template <int n>
SymmetricEigen<n> decomposed_of(const Matrix<n, n>& A) {
  using Plain = Eigen::Matrix<double, n, n>;
  const Eigen::SelfAdjointEigenSolver<Plain> solver((Plain(A)));
  return {solver.eigenvalues(), solver.eigenvectors(), solver.info() == Eigen::Success};
}

template <int n>
Matrix<n, 1> values_of(const Matrix<n, n>& A) {
  using Plain = Eigen::Matrix<double, n, n>;
  const Eigen::SelfAdjointEigenSolver<Plain> solver(Plain(A), Eigen::EigenvaluesOnly);
  if (solver.info() == Eigen::Success) return solver.eigenvalues();
  return Matrix<n, 1>::Constant(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace

SymmetricEigen<2> decomposed(const Matrix<2, 2>& A) { return decomposed_of<2>(A); }
SymmetricEigen<3> decomposed(const Matrix<3, 3>& A) { return decomposed_of<3>(A); }
SymmetricEigen<6> decomposed(const Matrix<6, 6>& A) { return decomposed_of<6>(A); }
Matrix<3, 1> values(const Matrix<3, 3>& A) { return values_of<3>(A); }
Matrix<6, 1> values(const Matrix<6, 6>& A) { return values_of<6>(A); }

}  // namespace tether::linalg::detail
