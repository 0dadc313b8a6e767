// Tether: transistor amplifier of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <problems/rows.hpp>
#include <problems/transistor_amplifier.hpp>

namespace tether::problems {

namespace {

constexpr double Ub = 6.0, Uf = .026, alpha = .99, beta = 1e-6, R0 = 1000.0, R = 9000.0;
constexpr double C1 = 1e-6, C2 = 2e-6, C3 = 3e-6, C4 = 4e-6, C5 = 5e-6;

double signal(double t) { return 0.1 * std::sin(200.0 * 3.14159265358979323846 * t); }
double diode(double u) { return beta * std::expm1(u / Uf); }
double diode_slope(double u) { return beta / Uf * std::exp(u / Uf); }

void currents(double t, const double* y, double* d) {
  const double F1 = diode(y[1] - y[2]), F2 = diode(y[4] - y[5]);
  d[0] = (y[0] - signal(t)) / R0;
  d[1] = y[1] / R + (y[1] - Ub) / R + (1.0 - alpha) * F1;
  d[2] = y[2] / R - F1;
  d[3] = (y[3] - Ub) / R + alpha * F1;
  d[4] = y[4] / R + (y[4] - Ub) / R + (1.0 - alpha) * F2;
  d[5] = y[5] / R - F2;
  d[6] = (y[6] - Ub) / R + alpha * F2;
  d[7] = y[7] / R;
}

}  // namespace

Problem transistor_amplifier() {
  // Both halves of each capacitor move together at the start; their common rate keeps the sums of
  // currents at zero.
  const double slope = beta / Uf, dU = 20.0 * 3.14159265358979323846;
  const double y3 = -3.0 / (C2 * R), y6 = -3.0 / (C4 * R);
  const double y2 =
      (dU / R0 + (1.0 - alpha) * slope * y3) / (1.0 / R0 + 2.0 / R + (1.0 - alpha) * slope);
  const double y5 =
      (-alpha * slope * (y2 - y3) + (1.0 - alpha) * slope * y6) / (3.0 / R + (1.0 - alpha) * slope);
  const double y8 = -alpha * slope * (y5 - y6) / (2.0 / R);
  Problem p = start_problem("transistor amplifier", "index 1", 1, 0.2, {0, 3, 3, 6, 3, 3, 6, 0},
                            {y2, y2, y3, y5, y5, y6, y8, y8}, std::vector<double>(8, 1.0));
  p.residual = [](double t, const double* y, const double* yp, double* r) {
    currents(t, y, r);
    const double i1 = C1 * (yp[0] - yp[1]), i3 = C3 * (yp[3] - yp[4]), i5 = C5 * (yp[6] - yp[7]);
    r[0] += i1;
    r[1] -= i1;
    r[2] += C2 * yp[2];
    r[3] += i3;
    r[4] -= i3;
    r[5] += C4 * yp[5];
    r[6] += i5;
    r[7] -= i5;
  };
  p.rows.push_back(make_rows(
      "currents", {"currents at C1", "currents at C3", "currents at C5"},
      [](double t, const double* y, double* r) {
        double d[8];
        currents(t, y, d);
        r[0] = d[0] + d[1];
        r[1] = d[3] + d[4];
        r[2] = d[6] + d[7];
      },
      [](double, const double* y, double* C) {
        const double s1 = diode_slope(y[1] - y[2]), s2 = diode_slope(y[4] - y[5]);
        C[0] = 1.0 / R0;
        C[1] = 2.0 / R + (1.0 - alpha) * s1;
        C[2] = -(1.0 - alpha) * s1;
        C[8 + 1] = alpha * s1;
        C[8 + 2] = -alpha * s1;
        C[8 + 3] = 1.0 / R;
        C[8 + 4] = 2.0 / R + (1.0 - alpha) * s2;
        C[8 + 5] = -(1.0 - alpha) * s2;
        C[16 + 4] = alpha * s2;
        C[16 + 5] = -alpha * s2;
        C[16 + 6] = 1.0 / R;
        C[16 + 7] = 1.0 / R;
      }));
  p.recommended = {"currents"};
  p.reference = {-0.5562145012262709e-2, 3.006522471903042, 2.849958788608128, 2.926422536206241,
                 2.704617865010554,      2.761837778393145, 4.770927631616772, 1.236995868091548};
  return p;
}

}  // namespace tether::problems
