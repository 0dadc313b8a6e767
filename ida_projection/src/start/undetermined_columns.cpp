// Tether: unknowns that a linear system does not determine. SPDX-License-Identifier: BSD-3-Clause
#include "start/undetermined_columns.hpp"

#include <tether/linalg/pivoted_qr.hpp>

namespace tether::ida_projection {

namespace {

constexpr double kDependentPivot = 1e-6;  // of the largest; difference quotients are this good

}  // namespace

std::vector<char> undetermined_columns(Eigen::MatrixXd a, bool scale_rows) {
  if (!a.allFinite()) return {};
  for (int pass = 0; pass < 2; ++pass) {
    for (int i = 0; scale_rows && i < a.rows(); ++i) {
      const double largest = a.row(i).lpNorm<Eigen::Infinity>();
      if (largest > 0.0) a.row(i) /= largest;
    }
    for (int j = 0; j < a.cols(); ++j) {
      const double largest = a.col(j).lpNorm<Eigen::Infinity>();
      if (largest > 0.0) a.col(j) /= largest;
    }
  }
  linalg::PivotedQr qr(kDependentPivot);
  qr.factor(a);
  const Eigen::Index n = a.cols(), rank = qr.rank();
  if (rank == n) return {};
  // R11 z1 + R12 z2 = 0, in the order of the pivots.
  Eigen::MatrixXd null = Eigen::MatrixXd::Identity(n, n).rightCols(n - rank);
  const Eigen::MatrixXd R = qr.R();
  null.topRows(rank) = -R.topLeftCorner(rank, rank)
                            .triangularView<Eigen::Upper>()
                            .solve(R.topRightCorner(rank, n - rank));
  const std::vector<int> order = qr.order();
  std::vector<char> found(static_cast<std::size_t>(n));
  for (Eigen::Index j = 0; j < n; ++j)
    found[static_cast<std::size_t>(order[static_cast<std::size_t>(j)])] =
        null.row(j).lpNorm<Eigen::Infinity>() > kDependentPivot;
  return found;
}

}  // namespace tether::ida_projection
