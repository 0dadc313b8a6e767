// Tether: singular values of a dense matrix. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/SVD>
#include <tether/linalg/singular_values.hpp>

namespace tether::linalg {

VectorX singular_values(MatrixView A) {
  return Eigen::JacobiSVD<Eigen::MatrixXd>(A).singularValues();
}

}  // namespace tether::linalg
