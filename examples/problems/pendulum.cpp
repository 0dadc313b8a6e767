// Tether: planar pendulum in Cartesian coordinates. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/pendulum.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

// sn, cn, dn of modulus k^2 = 1/2 by the arithmetic-geometric mean (Abramowitz and Stegun 16.4).
struct Elliptic {
  static constexpr int kLevels = 6;  // the mean converges quadratically; 4 suffice in long double
  long double a[kLevels + 1], c[kLevels + 1];

  Elliptic() {
    long double mean = 1.0L, other = std::sqrt(0.5L);
    a[0] = mean;
    c[0] = other;
    for (int i = 1; i <= kLevels; ++i) {
      c[i] = (mean - other) / 2.0L;
      const long double product = mean * other;
      mean = (mean + other) / 2.0L;
      other = std::sqrt(product);
      a[i] = mean;
    }
  }

  long double quarter_period() const { return std::acos(-1.0L) / (2.0L * a[kLevels]); }

  void evaluate(long double u, long double* sn, long double* cn, long double* dn) const {
    u = std::remainder(u, 4.0L * quarter_period());
    long double angle = std::ldexp(a[kLevels] * u, kLevels);
    for (int i = kLevels; i > 0; --i)
      angle = (angle + std::asin(c[i] / a[i] * std::sin(angle))) / 2.0L;
    *sn = std::sin(angle);
    *cn = std::cos(angle);
    *dn = std::sqrt(1.0L - *sn * *sn / 2.0L);
  }
};

const Elliptic& elliptic() {
  static const Elliptic functions;
  return functions;
}

}  // namespace

// With the angle phi from the downward vertical, sin(phi/2) = k cd(u), u = sqrt(g/L) t, k^2 = 1/2:
// x = L cn/dn^2, y = -L sn^2/(2 dn^2), phi' = -sqrt(g/L) sn/dn.
void pendulum_exact(double L, double g, double t, double y[5]) {
  const long double frequency =
      std::sqrt(static_cast<long double>(g) / static_cast<long double>(L));
  long double sn, cn, dn;
  elliptic().evaluate(frequency * static_cast<long double>(t), &sn, &cn, &dn);
  const long double px = L * cn / (dn * dn), py = -L * sn * sn / (2.0L * dn * dn);
  const long double spin = -frequency * sn / dn;
  y[0] = static_cast<double>(px);
  y[1] = static_cast<double>(py);
  y[2] = static_cast<double>(-py * spin);
  y[3] = static_cast<double>(px * spin);
  y[4] = static_cast<double>(-3.0L * g * py / (static_cast<long double>(L) * L));
}

double pendulum_period(double L, double g) {
  return static_cast<double>(4.0L * elliptic().quarter_period() *
                             std::sqrt(static_cast<long double>(L) / static_cast<long double>(g)));
}

std::vector<std::string> pendulum_forms() {
  return {"index 1", "index 1 x2", "index 1 w", "index 0", "GGL", "index 2", "index 3"};
}

Problem pendulum(double L, double g, double t_end, const std::string& form) {
  const std::vector<std::string> forms = pendulum_forms();
  if (std::find(forms.begin(), forms.end(), form) == forms.end())
    unknown_form("pendulum", form, forms);

  const bool with_w = form == "index 1 w", ggl = form == "GGL", index0 = form == "index 0";
  const bool constant_length = form == "index 1" || index0;
  const int N = with_w ? 7 : ggl ? 6 : 5;
  const int lam = with_w ? 6 : 4;  // where the multiplier stands
  const double L2 = L * L;

  Problem p;
  p.name = "pendulum";
  p.form = form;
  p.index = index0 ? 0 : form == "index 3" ? 3 : ggl || form == "index 2" ? 2 : 1;
  p.size = N;
  p.t_end = t_end;
  p.y0.assign(static_cast<std::size_t>(N), 0.0);
  p.yp0 = p.y0;
  p.id = p.y0;
  p.y0[0] = L;
  p.yp0[3] = -g;
  if (with_w) p.y0[5] = -g;
  for (std::size_t i = 0; i < 4; ++i) p.id[i] = 1.0;
  if (index0) p.id[4] = 1.0;
  if (p.index == 2) p.variable_index = {1, 1, 1, 1, 2};
  if (p.index == 3) p.variable_index = {1, 1, 2, 2, 3};
  if (ggl) p.variable_index.push_back(2);
  p.error_components = 4;

  double exact[5];
  pendulum_exact(L, g, t_end, exact);
  p.reference.assign(exact, exact + 5);
  if (with_w)
    p.reference = {
        exact[0], exact[1], exact[2], exact[3], -exact[0] * exact[4], -exact[1] * exact[4] - g,
        exact[4]};
  if (ggl) p.reference.push_back(0.0);

  if (with_w) {
    p.residual = [g](double, const double* y, const double* yp, double* r) {
      r[0] = yp[0] - y[2];
      r[1] = yp[1] - y[3];
      r[2] = yp[2] - y[4];
      r[3] = yp[3] - y[5];
      r[4] = y[4] + y[0] * y[6];
      r[5] = y[5] + y[1] * y[6] + g;
      r[6] = y[0] * y[4] + y[1] * y[5] + y[2] * y[2] + y[3] * y[3];
    };
    p.jacobian = [](double, double cj, const double* y, const double*, double* J) {
      std::fill(J, J + 49, 0.0);
      const auto set = [J](int row, int column, double entry) { J[row + 7 * column] = entry; };
      for (int i = 0; i < 4; ++i) {
        set(i, i, cj);
        set(i, i + 2, -1.0);
      }
      for (int i = 0; i < 2; ++i) {
        set(4 + i, i, y[6]);
        set(4 + i, 4 + i, 1.0);
        set(4 + i, 6, y[i]);
        set(6, i, y[4 + i]);
        set(6, 2 + i, 2.0 * y[2 + i]);
        set(6, 4 + i, y[i]);
      }
    };
  } else {
    enum class Last { fixed_length, squares, rate, velocity, position };
    const Last last = index0                 ? Last::rate
                      : form == "index 1"    ? Last::fixed_length
                      : form == "index 1 x2" ? Last::squares
                      : form == "index 3"    ? Last::position
                                             : Last::velocity;
    p.residual = [g, L2, ggl, last](double, const double* y, const double* yp, double* r) {
      r[0] = yp[0] - y[2];
      r[1] = yp[1] - y[3];
      r[2] = yp[2] + y[0] * y[4];
      r[3] = yp[3] + y[1] * y[4] + g;
      const double speed2 = y[2] * y[2] + y[3] * y[3];
      switch (last) {
        case Last::fixed_length:
          r[4] = speed2 - g * y[1] - L2 * y[4];
          break;
        case Last::squares:
          r[4] = speed2 - g * y[1] - (y[0] * y[0] + y[1] * y[1]) * y[4];
          break;
        case Last::rate:
          r[4] = L2 * yp[4] + 3.0 * g * y[3];
          break;
        case Last::velocity:
          r[4] = y[0] * y[2] + y[1] * y[3];
          break;
        case Last::position:
          r[4] = (y[0] * y[0] + y[1] * y[1] - L2) / 2.0;
          break;
      }
      if (ggl) {
        r[0] += y[5] * y[0];
        r[1] += y[5] * y[1];
        r[5] = (y[0] * y[0] + y[1] * y[1] - L2) / 2.0;
      }
    };
    p.jacobian = [g, L2, ggl, last, N](double, double cj, const double* y, const double*,
                                       double* J) {
      std::fill(J, J + N * N, 0.0);
      const auto set = [J, N](int row, int column, double entry) { J[row + N * column] = entry; };
      for (int i = 0; i < 2; ++i) {
        set(i, i, ggl ? cj + y[5] : cj);
        set(i, 2 + i, -1.0);
        set(2 + i, 2 + i, cj);
        set(2 + i, i, y[4]);
        set(2 + i, 4, y[i]);
        if (ggl) {
          set(i, 5, y[i]);
          set(5, i, y[i]);
        }
      }
      switch (last) {
        case Last::fixed_length:
          set(4, 1, -g);
          set(4, 2, 2.0 * y[2]);
          set(4, 3, 2.0 * y[3]);
          set(4, 4, -L2);
          break;
        case Last::squares:
          set(4, 0, -2.0 * y[0] * y[4]);
          set(4, 1, -g - 2.0 * y[1] * y[4]);
          set(4, 2, 2.0 * y[2]);
          set(4, 3, 2.0 * y[3]);
          set(4, 4, -y[0] * y[0] - y[1] * y[1]);
          break;
        case Last::rate:
          set(4, 3, 3.0 * g);
          set(4, 4, cj * L2);
          break;
        case Last::velocity:
          for (int i = 0; i < 2; ++i) {
            set(4, i, y[2 + i]);
            set(4, 2 + i, y[i]);
          }
          break;
        case Last::position:
          for (int i = 0; i < 2; ++i) set(4, i, y[i]);
          break;
      }
    };
  }

  p.rows.push_back(make_rows(
      "position", {"length"},
      [L2](double, const double* y, double* r) { r[0] = (y[0] * y[0] + y[1] * y[1] - L2) / 2.0; },
      [](double, const double* y, double* C) {
        C[0] = y[0];
        C[1] = y[1];
      },
      [L2](double, const double* y, double* r, double* C) {
        r[0] = (y[0] * y[0] + y[1] * y[1] - L2) / 2.0;
        C[0] = y[0];
        C[1] = y[1];
      }));
  p.rows.push_back(make_rows(
      "velocity", {"length rate"},
      [](double, const double* y, double* r) { r[0] = y[0] * y[2] + y[1] * y[3]; },
      [](double, const double* y, double* C) {
        C[0] = y[2];
        C[1] = y[3];
        C[2] = y[0];
        C[3] = y[1];
      },
      [](double, const double* y, double* r, double* C) {
        r[0] = y[0] * y[2] + y[1] * y[3];
        C[0] = y[2];
        C[1] = y[3];
        C[2] = y[0];
        C[3] = y[1];
      }));
  if (with_w) {
    p.rows.push_back(make_rows(
        "acceleration", {"length second rate"},
        [](double, const double* y, double* r) {
          r[0] = y[0] * y[4] + y[1] * y[5] + y[2] * y[2] + y[3] * y[3];
        },
        [](double, const double* y, double* C) {
          for (int i = 0; i < 2; ++i) {
            C[i] = y[4 + i];
            C[2 + i] = 2.0 * y[2 + i];
            C[4 + i] = y[i];
          }
        }));
  } else {
    p.rows.push_back(make_rows(
        "acceleration", {"tension"},
        [g, L2, constant_length](double, const double* y, double* r) {
          const double length2 = constant_length ? L2 : y[0] * y[0] + y[1] * y[1];
          r[0] = y[2] * y[2] + y[3] * y[3] - g * y[1] - length2 * y[4];
        },
        [g, L2, constant_length, lam](double, const double* y, double* C) {
          C[1] = -g;
          C[2] = 2.0 * y[2];
          C[3] = 2.0 * y[3];
          C[lam] = -L2;
          if (constant_length) return;
          C[0] = -2.0 * y[0] * y[lam];
          C[1] = -g - 2.0 * y[1] * y[lam];
          C[lam] = -y[0] * y[0] - y[1] * y[1];
        }));
  }
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [g](double, const double* y, double* r) {
        r[0] = (y[2] * y[2] + y[3] * y[3]) / 2.0 + g * y[1];
      },
      [g](double, const double* y, double* C) {
        C[1] = g;
        C[2] = y[2];
        C[3] = y[3];
      },
      [g](double, const double* y, double* r, double* C) {
        r[0] = (y[2] * y[2] + y[3] * y[3]) / 2.0 + g * y[1];
        C[1] = g;
        C[2] = y[2];
        C[3] = y[3];
      }));
  p.recommended = {"position", "velocity", "energy"};
  if (index0) p.recommended = {"position", "velocity", "acceleration", "energy"};
  return p;
}

}  // namespace tether::problems
