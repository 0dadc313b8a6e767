// Tether: starts of mechanisms, solved in long double. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <problems/wide_solves.hpp>

namespace tether::problems {

namespace {

using Wide = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

Wide widen(const double* rows, int m, int n) {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(rows, m, n).cast<long double>();
}

}  // namespace

void solve_motion_wide(int n, int m, const double* M, const double* G, double sign, const double* f,
                       const double* gamma, double* a, double* lam) {
  const Wide gradient = widen(G, m, n);
  Wide K = Wide::Zero(n + m, n + m), right(n + m, 1);
  K.topLeftCorner(n, n) = widen(M, n, n);
  K.topRightCorner(n, m) = sign * gradient.transpose();
  K.bottomLeftCorner(m, n) = gradient;
  right.topRows(n) = widen(f, n, 1);
  right.bottomRows(m) = -widen(gamma, m, 1);
  const Wide solution = K.fullPivLu().solve(right);
  for (int i = 0; i < n; ++i) a[i] = static_cast<double>(solution(i));
  for (int i = 0; i < m; ++i) lam[i] = static_cast<double>(solution(n + i));
}

void take_least_step_wide(int n, int m, const double* G, const double* r, double* x) {
  const Wide across = widen(G, m, n).transpose();
  const Wide normal = across.transpose() * across;
  const Wide step = across * normal.fullPivLu().solve(widen(r, m, 1));
  for (int i = 0; i < n; ++i) x[i] -= static_cast<double>(step(i));
}

}  // namespace tether::problems
