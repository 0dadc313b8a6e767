// Tether: impulses that hold all contacts of a mechanism. SPDX-License-Identifier: BSD-3-Clause
#include "joints/held_start.hpp"

#include <cmath>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/pivoted_qr.hpp>

namespace tether::contact::detail {

namespace {

constexpr double kRank = 1e-6;  // of rows in their own scale

Eigen::VectorXd scales(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  Eigen::VectorXd scale = A.diagonal();
  for (double& s : scale) s = s > 0 ? 1 / std::sqrt(s) : 0;
  return scale;
}

}  // namespace

bool share_loads(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  const Eigen::Index n = A.rows() / 3;
  const Eigen::VectorXd scale = scales(A);
  Eigen::MatrixXd normals(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      normals(i, j) = scale[3 * i] * A(3 * i, 3 * j) * scale[3 * j];
  linalg::PivotedQr of_normals(kRank);
  of_normals.factor(normals);
  return of_normals.rank() < n;
}

bool hold_all(const Eigen::Ref<const Eigen::MatrixXd>& A, const Eigen::VectorXd& b,
              const Eigen::VectorXd& mu, double tolerance, Eigen::VectorXd& x) {
  const double enough = 0.1 * tolerance * b.cwiseAbs().maxCoeff();
  const Eigen::VectorXd scale = scales(A);
  linalg::LeastSquares factor(kRank);
  factor.factor(scale.asDiagonal() * A * scale.asDiagonal());
  const Eigen::VectorXd held =
      scale.cwiseProduct(Eigen::VectorXd(factor.solve(scale.cwiseProduct(b))));
  for (Eigen::Index i = 0; i < mu.size(); ++i)
    if (!(held[3 * i] >= 0 && held.segment<2>(3 * i + 1).norm() <= mu[i] * held[3 * i]))
      return false;
  if (!((b - A * held).cwiseAbs().maxCoeff() <= enough)) return false;
  x = held;
  return true;
}

}  // namespace tether::contact::detail
