// Tether: predator and prey. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/lotka_volterra.hpp>
#include <problems/reference.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

Problem lotka_volterra(double x0, double y0, double t_end) {
  if (!(x0 > 0.0) || !(y0 > 0.0))
    throw std::invalid_argument("lotka volterra: the start must be positive");
  Problem p = start_problem("lotka volterra", "index 0", 0, t_end, {x0, y0},
                            {x0 * (1.0 - y0), y0 * (x0 - 1.0)}, {1, 1});
  p.residual = [](double, const double* y, const double* yp, double* r) {
    r[0] = yp[0] - y[0] * (1.0 - y[1]);
    r[1] = yp[1] - y[1] * (y[0] - 1.0);
  };
  p.jacobian = [](double, double cj, const double* y, const double*, double* J) {
    J[0] = cj - (1.0 - y[1]);
    J[1] = -y[1];
    J[2] = y[0];
    J[3] = cj - (y[0] - 1.0);
  };
  const double H = x0 - std::log(x0) + y0 - std::log(y0);
  p.rows.push_back(make_rows(
      "invariant", {"invariant"},
      [H](double, const double* y, double* r) {
        r[0] = y[0] - std::log(y[0]) + y[1] - std::log(y[1]) - H;
      },
      [](double, const double* y, double* C) {
        C[0] = 1.0 - 1.0 / y[0];
        C[1] = 1.0 - 1.0 / y[1];
      }));
  p.recommended = {"invariant"};
  const auto rate = [](const std::array<long double, 2>& y, std::array<long double, 2>& dy) {
    dy[0] = y[0] * (1.0L - y[1]);
    dy[1] = y[1] * (y[0] - 1.0L);
  };
  const auto end = reference_solution<2>(rate, {x0, y0}, t_end);
  p.reference.assign(end.begin(), end.end());
  return p;
}

}  // namespace tether::problems
