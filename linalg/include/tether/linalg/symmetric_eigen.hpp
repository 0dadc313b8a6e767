// Tether: eigenvalues of small symmetric matrices. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// Eigenvalues of a symmetric matrix, ascending, and unit eigenvectors as columns in that order.
/// The lower triangle is read. QR iteration of Eigen, compiled once; it does not converge where A
/// is not finite.
template <int n>
struct SymmetricEigen {
  Matrix<n, 1> values;   ///< ascending
  Matrix<n, n> vectors;  ///< column k belongs to values[k]
  bool converged;        ///< false: the others hold nothing
};

namespace detail {
SymmetricEigen<2> decomposed(const Matrix<2, 2>& A);
SymmetricEigen<3> decomposed(const Matrix<3, 3>& A);
SymmetricEigen<6> decomposed(const Matrix<6, 6>& A);
Matrix<3, 1> values(const Matrix<3, 3>& A);
Matrix<6, 1> values(const Matrix<6, 6>& A);
}  // namespace detail

/// A: 2 x 2, 3 x 3 or 6 x 6.
template <class Derived>
auto symmetric_eigen(const Eigen::MatrixBase<Derived>& A) {
  constexpr int n = Derived::RowsAtCompileTime;
  return detail::decomposed(Matrix<n, n>(A));
}
/// The values alone; NaN where that did not converge. A: 3 x 3 or 6 x 6.
template <class Derived>
auto symmetric_eigenvalues(const Eigen::MatrixBase<Derived>& A) {
  constexpr int n = Derived::RowsAtCompileTime;
  return detail::values(Matrix<n, n>(A));
}

}  // namespace tether::linalg
TETHER_EXPORT_END
