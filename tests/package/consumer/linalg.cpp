// Smallest user of tether::linalg: x + y = 2 has the minimum-norm solution (1, 1); more rows than
// the small sizes go through Eigen inside the library. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <tether/linalg.hpp>
#include <utility>
#include <vector>

namespace {

bool many_rows() {
  const int m = 20, n = 50;
  tether::linalg::MinimumNorm solver(m, n), other;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < n; ++j) solver.row(i)[j] = i == j ? 2.0 : 0.0;
  const std::vector<double> metric(n, 1.0), g(m, 1.0);
  std::vector<double> dy(n);
  const bool factored = solver.factor(metric.data());
  other = std::move(solver);
  other.solve(g.data(), dy.data());
  return factored && std::fabs(dy[0] - 0.5) < 1e-14 && std::fabs(dy[n - 1]) < 1e-14;
}

}  // namespace

bool use_linalg() {
  tether::linalg::MinimumNorm solver(1, 2);
  solver.row(0)[0] = solver.row(0)[1] = 1.0;
  const double metric[] = {1.0, 1.0}, g[] = {2.0};
  double dy[2] = {0.0, 0.0};
  if (!solver.factor(metric)) return false;
  solver.solve(g, dy);
  std::printf("dy = %g %g\n", dy[0], dy[1]);
  return std::fabs(dy[0] - 1.0) + std::fabs(dy[1] - 1.0) < 1e-14 && many_rows();
}
