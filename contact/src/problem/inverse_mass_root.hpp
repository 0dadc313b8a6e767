// Tether: the root of an inverse mass. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <tether/contact/bodies.hpp>

namespace tether::contact::detail {

/// C with C C' = inverse mass.
inline Matrix6d inverse_mass_root(const Matrix6d& inverse_mass) {
  using Plain = Eigen::Matrix<double, 6, 6>;
  const Eigen::LLT<Plain> cholesky((Plain(inverse_mass)));
  if (cholesky.info() == Eigen::Success) return Plain(cholesky.matrixL());
  const Eigen::SelfAdjointEigenSolver<Plain> eigen((Plain(inverse_mass)));
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

}  // namespace tether::contact::detail
