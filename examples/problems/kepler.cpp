// Tether: the two-body problem. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/kepler.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

// (x, y, vx, vy) at t with the eccentric anomaly from E - e sin E = t.
std::vector<double> exact(long double e, long double t) {
  const long double turn = 2.0L * std::acos(-1.0L);
  const long double mean = std::remainder(t, turn);
  // The root lies between mean and mean +- e; bisection first makes Newton safe for e near 1.
  long double low = mean - e, high = mean + e;
  for (int i = 0; i < 12; ++i) {
    const long double middle = (low + high) / 2.0L;
    (middle - e * std::sin(middle) > mean ? high : low) = middle;
  }
  long double E = (low + high) / 2.0L;
  for (int i = 0; i < 8; ++i) E -= (E - e * std::sin(E) - mean) / (1.0L - e * std::cos(E));
  const long double b = std::sqrt((1.0L - e) * (1.0L + e)), rate = 1.0L / (1.0L - e * std::cos(E));
  return {static_cast<double>(std::cos(E) - e), static_cast<double>(b * std::sin(E)),
          static_cast<double>(-std::sin(E) * rate), static_cast<double>(b * std::cos(E) * rate)};
}

}  // namespace

Problem kepler(double e, double t_end) {
  if (!(e >= 0.0 && e < 1.0)) throw std::invalid_argument("kepler: 0 <= e < 1");
  const std::vector<double> y0 = exact(e, 0.0L);
  Problem p = start_problem("kepler", "index 0", 0, t_end, y0,
                            {y0[2], y0[3], -1.0 / (y0[0] * y0[0]), 0.0}, {1, 1, 1, 1});
  p.reference = exact(e, t_end);
  p.residual = [](double, const double* y, const double* yp, double* r) {
    const double r2 = y[0] * y[0] + y[1] * y[1], pull = 1.0 / (r2 * std::sqrt(r2));
    r[0] = yp[0] - y[2];
    r[1] = yp[1] - y[3];
    r[2] = yp[2] + y[0] * pull;
    r[3] = yp[3] + y[1] * pull;
  };
  p.jacobian = [](double, double cj, const double* y, const double*, double* J) {
    const double r2 = y[0] * y[0] + y[1] * y[1], pull = 1.0 / (r2 * std::sqrt(r2));
    for (int i = 0; i < 16; ++i) J[i] = 0.0;
    for (int i = 0; i < 4; ++i) J[5 * i] = cj;
    J[8] = J[13] = -1.0;
    J[2] = pull * (1.0 - 3.0 * y[0] * y[0] / r2);
    J[7] = pull * (1.0 - 3.0 * y[1] * y[1] / r2);
    J[3] = J[6] = -3.0 * pull * y[0] * y[1] / r2;
  };
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [](double, const double* y, double* r) {
        r[0] = (y[2] * y[2] + y[3] * y[3]) / 2.0 - 1.0 / std::sqrt(y[0] * y[0] + y[1] * y[1]) + 0.5;
      },
      [](double, const double* y, double* C) {
        const double r2 = y[0] * y[0] + y[1] * y[1], pull = 1.0 / (r2 * std::sqrt(r2));
        C[0] = y[0] * pull;
        C[1] = y[1] * pull;
        C[2] = y[2];
        C[3] = y[3];
      }));
  const double momentum = std::sqrt((1.0 - e) * (1.0 + e));
  p.rows.push_back(make_rows(
      "momentum", {"angular momentum"},
      [momentum](double, const double* y, double* r) {
        r[0] = y[0] * y[3] - y[1] * y[2] - momentum;
      },
      [](double, const double* y, double* C) {
        C[0] = y[3];
        C[1] = -y[2];
        C[2] = -y[1];
        C[3] = y[0];
      }));
  p.rows.push_back(make_rows(
      "eccentricity", {"eccentricity x", "eccentricity y"},
      [e](double, const double* y, double* r) {
        const double L = y[0] * y[3] - y[1] * y[2];
        const double distance = std::sqrt(y[0] * y[0] + y[1] * y[1]);
        r[0] = y[3] * L - y[0] / distance - e;
        r[1] = -y[2] * L - y[1] / distance;
      },
      [](double, const double* y, double* C) {
        const double L = y[0] * y[3] - y[1] * y[2];
        const double r2 = y[0] * y[0] + y[1] * y[1], pull = 1.0 / (r2 * std::sqrt(r2));
        C[0] = y[3] * y[3] - y[1] * y[1] * pull;
        C[1] = -y[3] * y[2] + y[0] * y[1] * pull;
        C[2] = -y[3] * y[1];
        C[3] = L + y[3] * y[0];
        C[4] = -y[2] * y[3] + y[0] * y[1] * pull;
        C[5] = y[2] * y[2] - y[0] * y[0] * pull;
        C[6] = -L + y[2] * y[1];
        C[7] = -y[2] * y[0];
      }));
  p.recommended = {"energy", "momentum", "eccentricity"};
  return p;
}

}  // namespace tether::problems
