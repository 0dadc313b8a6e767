// Tether: motions without constraints that keep invariants. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/rows.hpp>
#include <vector>

#include "host.hpp"
#include "motions.hpp"

namespace tether::test {

namespace {

/// invariants(y, g) writes m values, gradient(y, C) their m x n Jacobian; kept at their values at
/// the start.
template <class Invariants, class Gradient>
void keep(Problem* p, const std::vector<std::string>& names, Invariants invariants,
          Gradient gradient) {
  std::vector<double> at_start(names.size());
  invariants(p->y0.data(), at_start.data());
  p->rows.push_back(problems::make_rows(
      "all", names,
      [invariants, at_start](double, const double* y, double* g) {
        invariants(y, g);
        for (std::size_t i = 0; i < at_start.size(); ++i) g[i] -= at_start[i];
      },
      [gradient](double, const double* y, double* C) { gradient(y, C); }));
  p->recommended = {"all"};
}

constexpr double kTwoPi = 6.28318530717958648;
constexpr double kStrength[4] = {1.0, 0.7, -0.4, 1.3};

/// body(i, j, dx, dy, r^2), with the vector from j to i, for all pairs i != j.
template <class Body>
void for_pairs(int count, const double* y, Body body) {
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) {
      if (i == j) continue;
      const double dx = y[2 * i] - y[2 * j], dy = y[2 * i + 1] - y[2 * j + 1];
      body(i, j, dx, dy, dx * dx + dy * dy);
    }
}

}  // namespace

Problem vortices(double t_end) {
  Problem p = ode({1.0, 0.0, -0.5, 0.8, 0.3, -1.1, -1.0, -0.4}, t_end,
                  [](double, const double* y, double* f) {
                    std::fill(f, f + 8, 0.0);
                    for_pairs(4, y, [f](int i, int j, double dx, double dy, double square) {
                      f[2 * i] -= kStrength[j] * dy / (kTwoPi * square);
                      f[2 * i + 1] += kStrength[j] * dx / (kTwoPi * square);
                    });
                  });
  p.name = "vortices";
  keep(
      &p, {"impulse x", "impulse y", "angular impulse", "Hamiltonian"},
      [](const double* y, double* g) {
        std::fill(g, g + 4, 0.0);
        for (int i = 0; i < 4; ++i) {
          g[0] += kStrength[i] * y[2 * i];
          g[1] += kStrength[i] * y[2 * i + 1];
          g[2] += kStrength[i] * (y[2 * i] * y[2 * i] + y[2 * i + 1] * y[2 * i + 1]);
        }
        for_pairs(4, y, [g](int i, int j, double, double, double square) {
          g[3] -= kStrength[i] * kStrength[j] * std::log(square) / (4.0 * kTwoPi);
        });
      },
      [](const double* y, double* C) {
        for (int i = 0; i < 4; ++i) {
          C[2 * i] = C[8 + 2 * i + 1] = kStrength[i];
          C[16 + 2 * i] = 2.0 * kStrength[i] * y[2 * i];
          C[16 + 2 * i + 1] = 2.0 * kStrength[i] * y[2 * i + 1];
        }
        for_pairs(4, y, [C](int i, int j, double dx, double dy, double square) {
          const double slope = kStrength[i] * kStrength[j] / (kTwoPi * square);
          C[24 + 2 * i] -= slope * dx;
          C[24 + 2 * i + 1] -= slope * dy;
        });
      });
  return p;
}

namespace {

constexpr double kAcross = 1.0, kAlong = 0.5, kWeight = 1.0;  // of the top

/// The vertical in the body's frame, and its 3 x 4 derivative to the quaternion.
void vertical(const double* p, double* r) {
  r[0] = 2.0 * (p[1] * p[3] - p[0] * p[2]);
  r[1] = 2.0 * (p[2] * p[3] + p[0] * p[1]);
  r[2] = p[0] * p[0] - p[1] * p[1] - p[2] * p[2] + p[3] * p[3];
}
void vertical_slope(const double* p, double* R) {
  const double rows[12] = {-p[2], p[3], -p[0], p[1],  p[1],  p[0],
                           p[3],  p[2], p[0],  -p[1], -p[2], p[3]};
  for (int e = 0; e < 12; ++e) R[e] = 2.0 * rows[e];
}

}  // namespace

Problem lagrange_top(double t_end) {
  Problem p = ode({std::cos(0.25), std::sin(0.25), 0.0, 0.0, 0.1, 0.2, 6.0}, t_end,
                  [](double, const double* y, double* f) {
                    const double* w = y + 4;
                    double r[3];
                    vertical(y, r);
                    f[0] = -0.5 * (y[1] * w[0] + y[2] * w[1] + y[3] * w[2]);
                    f[1] = 0.5 * (y[0] * w[0] + y[2] * w[2] - y[3] * w[1]);
                    f[2] = 0.5 * (y[0] * w[1] + y[3] * w[0] - y[1] * w[2]);
                    f[3] = 0.5 * (y[0] * w[2] + y[1] * w[1] - y[2] * w[0]);
                    f[4] = ((kAcross - kAlong) * w[1] * w[2] + kWeight * r[1]) / kAcross;
                    f[5] = ((kAlong - kAcross) * w[0] * w[2] - kWeight * r[0]) / kAcross;
                    f[6] = 0.0;
                  });
  p.name = "Lagrange's top";
  keep(
      &p, {"norm", "energy", "vertical momentum", "axial momentum"},
      [](const double* y, double* g) {
        const double* w = y + 4;
        double r[3];
        vertical(y, r);
        g[0] = 0.5 * (y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3]);
        g[1] =
            0.5 * (kAcross * (w[0] * w[0] + w[1] * w[1]) + kAlong * w[2] * w[2]) + kWeight * r[2];
        g[2] = kAcross * (w[0] * r[0] + w[1] * r[1]) + kAlong * w[2] * r[2];
        g[3] = w[2];
      },
      [](const double* y, double* C) {
        const double inertia[3] = {kAcross, kAcross, kAlong};
        double r[3], R[12];
        vertical(y, r);
        vertical_slope(y, R);
        for (int j = 0; j < 4; ++j) {
          C[j] = y[j];
          C[7 + j] = kWeight * R[8 + j];
          for (int k = 0; k < 3; ++k) C[14 + j] += inertia[k] * y[4 + k] * R[4 * k + j];
        }
        for (int k = 0; k < 3; ++k) {
          C[7 + 4 + k] = inertia[k] * y[4 + k];
          C[14 + 4 + k] = inertia[k] * r[k];
        }
        C[21 + 6] = 1.0;
      });
  return p;
}

Problem figure_eight(double t_end) {
  const double x = 0.97000436, y = -0.24308753, u = 0.93240737, v = 0.86473146;
  Problem p = ode({x, y, -x, -y, 0.0, 0.0, u / 2.0, v / 2.0, u / 2.0, v / 2.0, -u, -v}, t_end,
                  [](double, const double* at, double* f) {
                    std::copy(at + 6, at + 12, f);
                    std::fill(f + 6, f + 12, 0.0);
                    for_pairs(3, at, [f](int i, int, double dx, double dy, double square) {
                      f[6 + 2 * i] -= dx / (square * std::sqrt(square));
                      f[6 + 2 * i + 1] -= dy / (square * std::sqrt(square));
                    });
                  });
  p.name = "figure eight";
  keep(
      &p, {"centre x", "centre y", "momentum x", "momentum y", "energy", "angular momentum"},
      [](const double* at, double* g) {
        std::fill(g, g + 6, 0.0);
        for (int i = 0; i < 3; ++i) {
          const double *q = at + 2 * i, *w = q + 6;
          for (int k = 0; k < 2; ++k) {
            g[k] += q[k];
            g[2 + k] += w[k];
            g[4] += 0.5 * w[k] * w[k];
          }
          g[5] += q[0] * w[1] - q[1] * w[0];
        }
        for_pairs(3, at, [g](int, int, double, double, double square) {
          g[4] -= 0.5 / std::sqrt(square);
        });
      },
      [](const double* at, double* C) {
        for (int i = 0; i < 3; ++i) {
          const double *q = at + 2 * i, *w = q + 6;
          for (int k = 0; k < 2; ++k) {
            C[12 * k + 2 * i + k] = C[12 * (2 + k) + 6 + 2 * i + k] = 1.0;
            C[48 + 6 + 2 * i + k] = w[k];
          }
          C[60 + 2 * i] = w[1];
          C[60 + 2 * i + 1] = -w[0];
          C[60 + 6 + 2 * i] = -q[1];
          C[60 + 6 + 2 * i + 1] = q[0];
        }
        for_pairs(3, at, [C](int i, int, double dx, double dy, double square) {
          C[48 + 2 * i] += dx / (square * std::sqrt(square));
          C[48 + 2 * i + 1] += dy / (square * std::sqrt(square));
        });
      });
  return p;
}

}  // namespace tether::test
