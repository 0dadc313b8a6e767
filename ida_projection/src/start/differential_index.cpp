// Tether: the index of a linear system. SPDX-License-Identifier: BSD-3-Clause
#include "start/differential_index.hpp"

#include <tether/linalg/pivoted_qr.hpp>

namespace tether::ida_projection {

namespace {

constexpr int kHighestIndex = 4;
constexpr double kSmallPivot = 1e-5;  // of the largest; products of difference quotients

}  // namespace

int differential_index(Eigen::MatrixXd E, Eigen::MatrixXd A) {
  const Eigen::Index n = E.rows();
  linalg::PivotedQr qr(kSmallPivot);
  for (int index = 0; index <= kHighestIndex; ++index) {
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
