// Tether: chemical Akzo Nobel problem of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <problems/akzo_nobel.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

constexpr double kEquilibrium = 115.83;  // Ks

// Rates of change of the five concentrations; NaN for a negative y2.
void rates(const double* y, double* dy) {
  constexpr double k1 = 18.7, k2 = .58, k3 = .09, k4 = .42, K = 34.4, klA = 3.3, pressure = .9,
                   henry = 737.0;
  const double root = std::sqrt(y[1]);
  const double r1 = k1 * y[0] * y[0] * y[0] * y[0] * root, r2 = k2 * y[2] * y[3];
  const double r3 = k2 / K * y[0] * y[4], r4 = k3 * y[0] * y[3] * y[3],
               r5 = k4 * y[5] * y[5] * root;
  const double inflow = klA * (pressure / henry - y[1]);
  dy[0] = -2.0 * r1 + r2 - r3 - r4;
  dy[1] = -0.5 * r1 - r4 - 0.5 * r5 + inflow;
  dy[2] = r1 - r2 + r3;
  dy[3] = -r2 + r3 - 2.0 * r4;
  dy[4] = r2 - r3 + r5;
}

}  // namespace

Problem akzo_nobel() {
  std::vector<double> y0 = {.444, .00123, 0.0, .007, 0.0, kEquilibrium * .444 * .007}, yp0(6);
  rates(y0.data(), yp0.data());
  yp0[5] = kEquilibrium * (yp0[0] * y0[3] + y0[0] * yp0[3]);
  Problem p = start_problem("akzo nobel", "index 1", 1, 180.0, y0, yp0, {1, 1, 1, 1, 1, 0});
  p.residual = [](double, const double* y, const double* yp, double* r) {
    rates(y, r);
    for (int i = 0; i < 5; ++i) r[i] = yp[i] - r[i];
    r[5] = kEquilibrium * y[0] * y[3] - y[5];
  };
  p.rows.push_back(make_rows(
      "equilibrium", {"equilibrium"},
      [](double, const double* y, double* r) { r[0] = kEquilibrium * y[0] * y[3] - y[5]; },
      [](double, const double* y, double* C) {
        C[0] = kEquilibrium * y[3];
        C[3] = kEquilibrium * y[0];
        C[5] = -1.0;
      }));
  p.recommended = {"equilibrium"};
  p.reference = {0.1150794920661702,    0.1203831471567715e-2, 0.1611562887407974,
                 0.3656156421249283e-3, 0.1708010885264404e-1, 0.4873531310307455e-2};
  return p;
}

}  // namespace tether::problems
