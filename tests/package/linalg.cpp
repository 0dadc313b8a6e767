// Smallest user of tether::linalg: x + y = 2 has the minimum-norm solution (1, 1).
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <tether/linalg.hpp>

int main() {
  tether::linalg::MinimumNorm solver(1, 2);
  solver.row(0)[0] = solver.row(0)[1] = 1.0;
  const double metric[] = {1.0, 1.0}, g[] = {2.0};
  double dy[2] = {0.0, 0.0};
  if (!solver.factor(metric)) return 1;
  solver.solve(g, dy);
  std::printf("dy = %g %g\n", dy[0], dy[1]);
  return std::fabs(dy[0] - 1.0) + std::fabs(dy[1] - 1.0) < 1e-14 ? 0 : 1;
}
