// Tether: the root of an inverse mass. SPDX-License-Identifier: BSD-3-Clause
#include "problem/inverse_mass_root.hpp"

#include <Eigen/Cholesky>
#include <tether/linalg/symmetric_eigen.hpp>

namespace tether::contact::detail {

Matrix6d inverse_mass_root(const Matrix6d& inverse_mass) {
  using Plain = Eigen::Matrix<double, 6, 6>;
  const Eigen::LLT<Plain> cholesky((Plain(inverse_mass)));
  if (cholesky.info() == Eigen::Success) return Plain(cholesky.matrixL());
  const linalg::SymmetricEigen<6> eigen =
      linalg::symmetric_eigen(linalg::Matrix<6, 6>(inverse_mass));
  return eigen.vectors * eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

}  // namespace tether::contact::detail
