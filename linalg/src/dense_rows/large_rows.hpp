// Tether: factors of more rows than small_orthogonal.hpp takes. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <tether/linalg/minimum_norm.hpp>
#include <vector>

#include "kept_rows.hpp"
#include "remainders.hpp"

namespace tether::linalg {

// Factors of A A^T determine the square of a larger sine to a relative error of 1e-10.
constexpr double kLeastSine = 1e-3;

struct MinimumNorm::Large {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> A;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  Eigen::VectorXd work, rhs;
  std::vector<int> order;  // pivot order
  KeptRows kept;           // of factor_kept() and factor_split()
  // The factor that brings each row of C D to unit length, 1 for a row that vanishes. It is used if
  // kept rows solve alone.
  std::vector<double> to_unit;
  void learn_units(const std::vector<double>& row_norm);

  // of factor_split()
  bool split = false;
  int firm = 0;              // of the pivot order
  std::vector<int> natural;  // 0, 1, ..
  Remainders rest;           // of the others
  Eigen::VectorXd left;
};

}  // namespace tether::linalg
