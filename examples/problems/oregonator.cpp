// Tether: Oregonator of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <problems/oregonator.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

void rates(const double* y, double* dy) {
  constexpr double fast = 77.27, square = 8.375e-6, slow = 0.161;
  dy[0] = fast * (y[1] + y[0] * (1.0 - square * y[0] - y[1]));
  dy[1] = (y[2] - (1.0 + y[0]) * y[1]) / fast;
  dy[2] = slow * (y[0] - y[2]);
}

}  // namespace

Problem oregonator() {
  const std::vector<double> y0 = {1.0, 2.0, 3.0};
  std::vector<double> yp0(3);
  rates(y0.data(), yp0.data());
  Problem p = start_problem("oregonator", "index 0", 0, 360.0, y0, yp0, {1, 1, 1});
  p.residual = [](double, const double* y, const double* yp, double* r) {
    rates(y, r);
    for (int i = 0; i < 3; ++i) r[i] = yp[i] - r[i];
  };
  p.reference = {0.1000814870318523e1, 0.1228178521549917e4, 0.1320554942846706e3};
  return p;
}

}  // namespace tether::problems
