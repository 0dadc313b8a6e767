// Tether: what a linear system of difference quotients determines. SPDX-License-Identifier:
// BSD-3-Clause
#include "start/linear_system.hpp"

#include <tether/linalg/pivoted_qr.hpp>

#include "host/rounding.hpp"

namespace tether::ida_projection {

std::vector<char> undetermined_columns(Eigen::MatrixXd a, bool scale_rows) {
  if (!a.allFinite()) return {};
  const auto scale = [](auto vectors) {
    for (auto v : vectors) {
      const double largest = v.template lpNorm<Eigen::Infinity>();
      if (largest > 0.0) v /= largest;
    }
  };
  for (int pass = 0; pass < 2; ++pass) {
    if (scale_rows) scale(a.rowwise());
    scale(a.colwise());
  }
  linalg::PivotedQr qr(kQuotientRounding);
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
        null.row(j).lpNorm<Eigen::Infinity>() > kQuotientRounding;
  return found;
}

int differential_index(Eigen::MatrixXd E, Eigen::MatrixXd A) {
  const Eigen::Index n = E.rows();
  linalg::PivotedQr qr(kProductRounding);
  for (int index = 0; index <= 4; ++index) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const double size = E.row(i).lpNorm<Eigen::Infinity>();
      if (!(size > 0.0)) continue;
      E.row(i) /= size;
      A.row(i) /= size;
    }
    qr.factor(E);
    const Eigen::Index rank = qr.rank();
    if (rank == n) return index;
    const Eigen::MatrixXd Q = qr.Q();
    E = Q.transpose() * E;
    A = Q.transpose() * A;
    // Equations without y' are differentiated: what was multiplied by y is so by y'.
    E.bottomRows(n - rank) = A.bottomRows(n - rank);
    A.bottomRows(n - rank).setZero();
  }
  return -1;
}

}  // namespace tether::ida_projection
