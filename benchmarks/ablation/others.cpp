// Tether: problems that no mechanism was made for. SPDX-License-Identifier: BSD-3-Clause
#include "ablation/others.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "projection/run.hpp"

namespace tether::bench {

namespace {

using ida_projection::ConstVector;
using ida_projection::Vector;
using Vectors = std::vector<double>;

problems::Problem problem(const char* name, double t_end, Vectors y0, Vectors yp0, Vectors id) {
  problems::Problem p;
  p.name = name;
  p.index = 0;
  for (const double differential : id)
    if (differential == 0.0) p.index = 1;
  p.form = p.index == 0 ? "index 0" : "index 1";
  p.size = p.error_components = static_cast<int>(y0.size());
  p.t_end = t_end;
  p.y0 = std::move(y0);
  p.yp0 = std::move(yp0);
  p.id = std::move(id);
  return p;
}

template <class Slopes>
problems::Problem explicit_problem(const char* name, double t_end, Vectors y0, Slopes slopes) {
  const std::size_t n = y0.size();
  Vectors yp0(n);
  slopes(y0.data(), yp0.data());
  problems::Problem p = problem(name, t_end, std::move(y0), yp0, Vectors(n, 1.0));
  p.residual = [=](double, const double* y, const double* yp, double* r) {
    slopes(y, r);
    for (std::size_t i = 0; i < n; ++i) r[i] = yp[i] - r[i];
  };
  return p;
}

/// g(t, y) has `count` values; those at the start are subtracted.
template <class Values>
void keep(problems::Problem* p, int count, Values values) {
  Vectors start(static_cast<std::size_t>(count));
  values(0.0, p->y0.data(), start.data());
  problems::Rows rows;
  rows.name = "all";
  rows.constraints.count = count;
  rows.constraints.value = [=](double t, ConstVector y, Vector g) {
    values(t, y.data(), g.data());
    for (int i = 0; i < count; ++i) g[i] -= start[static_cast<std::size_t>(i)];
  };
  p->rows.push_back(std::move(rows));
  p->recommended = {"all"};
}

// theta, omega, and what is read: sin 7 theta, exp(cos 3 theta), the torque.
problems::Problem arm() {
  problems::Problem p = problem("arm with outputs", 12.0, {0.0, 2.5, 0.0, std::exp(1.0), 0.0},
                                {2.5, 0.0, 17.5, 0.0, -2.5}, {1, 1, 0, 0, 0});
  p.residual = [](double, const double* y, const double* yp, double* r) {
    r[0] = yp[0] - y[1];
    r[1] = yp[1] - y[4];
    r[2] = y[2] - std::sin(7 * y[0]);
    r[3] = y[3] - std::exp(std::cos(3 * y[0]));
    r[4] = y[4] + std::sin(y[0]);
  };
  keep(&p, 1, [](double, const double* y, double* g) { g[0] = y[1] * y[1] / 2 - std::cos(y[0]); });
  return p;
}

// A base b is added to an acid that decays: b, H, OH, A, HA, C.
problems::Problem titration() {
  constexpr double kWater = 1e-6, kAcid = 1e-2, kDecay = 0.2;
  const auto residual = [=](double, const double* y, const double* yp, double* r) {
    r[0] = yp[0] - 1.0;
    r[1] = y[0] + y[1] - y[2] - y[3];
    r[2] = kWater - y[1] * y[2];
    r[3] = kAcid * y[4] - y[1] * y[3];
    r[4] = y[3] + y[4] - y[5];
    r[5] = yp[5] + kDecay * y[5] * y[1];
  };
  const auto at = [=](double b, double C) {
    double low = 1e-12, high = 1e2, H = 1.0;
    for (int i = 0; i < 200; ++i) {
      H = std::sqrt(low * high);
      (b + H - kWater / H - C * kAcid / (H + kAcid) > 0 ? high : low) = H;
    }
    return Vectors{b, H, kWater / H, C * kAcid / (H + kAcid), C * H / (H + kAcid), C};
  };
  const Vectors y0 = at(0.0, 1.0);
  const double dC = -kDecay * y0[1], dt = 1e-7;
  Vectors yp0 = at(dt, 1.0 + dC * dt);
  for (std::size_t i = 0; i < yp0.size(); ++i) yp0[i] = (yp0[i] - y0[i]) / dt;
  problems::Problem p = problem("titration", 2.0, y0, yp0, {1, 0, 0, 0, 0, 1});
  p.residual = residual;
  p.atol_scale = {1, 1e-3, 1e-3, 1e-3, 1e-3, 1};
  keep(&p, 1, [](double t, const double* y, double* g) { g[0] = y[0] - t; });
  return p;
}

// In the plane; energy and angular momentum, whose gradients are parallel on a circle.
problems::Problem circular_orbit() {
  problems::Problem p =
      explicit_problem("circular orbit", 20.0, {1, 0, 0, 1}, [](const double* y, double* f) {
        const double r = std::hypot(y[0], y[1]);
        for (int i = 0; i < 2; ++i) {
          f[i] = y[2 + i];
          f[2 + i] = -y[i] / (r * r * r);
        }
      });
  keep(&p, 2, [](double, const double* y, double* g) {
    g[0] = (y[2] * y[2] + y[3] * y[3]) / 2 - 1.0 / std::hypot(y[0], y[1]);
    g[1] = y[0] * y[3] - y[1] * y[2];
  });
  return p;
}

// In the plane; energy, momentum and angular momentum.
problems::Problem three_bodies() {
  static constexpr double kMass[3] = {1.0, 0.8, 0.5};
  problems::Problem p = explicit_problem(
      "three bodies", 10.0, {1, 0, -0.7, 0.6, -0.5, -0.9, 0.1, 0.6, -0.5, -0.3, 0.7, -0.2},
      [](const double* y, double* f) {
        for (int i = 0; i < 6; ++i) {
          f[i] = y[6 + i];
          f[6 + i] = 0.0;
        }
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) {
            if (i == j) continue;
            const double dx = y[2 * j] - y[2 * i], dy = y[2 * j + 1] - y[2 * i + 1];
            const double pull = kMass[j] / std::pow(std::hypot(dx, dy), 3);
            f[6 + 2 * i] += pull * dx;
            f[7 + 2 * i] += pull * dy;
          }
      });
  keep(&p, 4, [](double, const double* y, double* g) {
    std::fill(g, g + 4, 0.0);
    for (int i = 0; i < 3; ++i) {
      const double *q = y + 2 * i, *v = q + 6;
      g[0] += kMass[i] * (v[0] * v[0] + v[1] * v[1]) / 2;
      for (int j = 0; j < i; ++j)
        g[0] -= kMass[i] * kMass[j] / std::hypot(q[0] - y[2 * j], q[1] - y[2 * j + 1]);
      g[1] += kMass[i] * v[0];
      g[2] += kMass[i] * v[1];
      g[3] += kMass[i] * (q[0] * v[1] - q[1] * v[0]);
    }
  });
  return p;
}

// R by rows and the angular velocity in the body; R'R = 1, energy, vertical momentum.
problems::Problem top() {
  static constexpr double kInertia[3] = {1.0, 1.2, 0.5}, kWeight = 2.0;
  const double c = std::cos(0.4), s = std::sin(0.4);
  problems::Problem p = explicit_problem(
      "top in rotation matrices", 5.0, {1, 0, 0, 0, c, -s, 0, s, c, 0.3, -0.2, 6},
      [](const double* y, double* f) {
        const double *w = y + 9, torque[3] = {kWeight * y[7], -kWeight * y[6], 0.0};
        for (int i = 0; i < 3; ++i) {
          const int j = (i + 1) % 3, k = (i + 2) % 3;
          for (int row = 0; row < 9; row += 3) f[row + i] = y[row + j] * w[k] - y[row + k] * w[j];
          f[9 + i] = ((kInertia[j] - kInertia[k]) * w[j] * w[k] + torque[i]) / kInertia[i];
        }
      });
  keep(&p, 8, [](double, const double* y, double* g) {
    int row = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
        g[row++] = y[3 * i] * y[3 * j] + y[3 * i + 1] * y[3 * j + 1] + y[3 * i + 2] * y[3 * j + 2];
    g[6] = kWeight * y[8];
    g[7] = 0.0;
    for (int i = 0; i < 3; ++i) {
      g[6] += kInertia[i] * y[9 + i] * y[9 + i] / 2;
      g[7] += kInertia[i] * y[6 + i] * y[9 + i];
    }
  });
  return p;
}

// Six particles on a ring; the traces of L^2 and L^3 beside the momentum.
problems::Problem toda() {
  static constexpr int N = 6;
  Vectors y0;
  for (int i = 0; i < N; ++i) y0.push_back(0.3 * std::sin(1.0 + i));
  for (int i = 0; i < N; ++i) y0.push_back(0.8 * std::cos(2.0 * i));
  problems::Problem p = explicit_problem("Toda lattice", 20.0, y0, [](const double* y, double* f) {
    for (int i = 0; i < N; ++i) {
      f[i] = y[N + i];
      f[N + i] = std::exp(y[(i + N - 1) % N] - y[i]) - std::exp(y[i] - y[(i + 1) % N]);
    }
  });
  keep(&p, 3, [](double, const double* y, double* g) {
    g[0] = g[1] = g[2] = 0.0;
    for (int i = 0; i < N; ++i) {
      const double v = y[N + i], next = y[N + (i + 1) % N], pull = std::exp(y[i] - y[(i + 1) % N]);
      g[0] += v;
      g[1] += v * v / 2 + pull;
      g[2] += v * v * v / 3 + (v + next) * pull;
    }
  });
  return p;
}

/// Masses of 1 kg in the plane on rods of 0.1 m, level and at rest at first, from the origin: q, v,
/// the rods' forces by length. Springs keep joints straight, spring |q_{i+1} - 2 q_i + q_{i-1}|^2 /
/// 2 each. Lengths and their rates are kept.
problems::Problem rods(const char* name, double spring, int index, double t_end) {
  static constexpr int N = 60;
  static constexpr double kRod = 0.1, kGravity = 9.81;
  const auto along = [](const double* x, int a) { return a >= 2 ? x[a] - x[a - 2] : x[a]; };
  Vectors y0(5 * N, 0.0), yp0 = y0, id(5 * N, 1.0);
  for (std::size_t i = 0; i < N; ++i) {
    y0[2 * i] = static_cast<double>(i + 1) * kRod;
    yp0[2 * N + 2 * i + 1] = -kGravity;
    id[4 * N + i] = 0.0;
  }
  problems::Problem p = problem(name, t_end, y0, yp0, id);
  p.index = index;
  p.form = fmt::format("index {}", index);
  p.error_components = 4 * N;
  p.residual = [=](double, const double* y, const double* yp, double* r) {
    const double *v = y + 2 * N, *pull = y + 4 * N;
    double* const force = r + 2 * N;
    for (int a = 0; a < 2 * N; ++a) {
      r[a] = yp[a] - v[a];
      force[a] = yp[2 * N + a] + (a % 2 == 1 ? kGravity : 0.0);
    }
    for (int a = 0; a + 2 < 2 * N; ++a) {
      const double moment = spring * (along(y, a + 2) - along(y, a));
      force[a + 2] += moment;
      force[a] -= 2.0 * moment;
      if (a >= 2) force[a - 2] += moment;
    }
    for (int i = 0; i < N; ++i) {
      double rate = 0.0, second = 0.0;
      for (int a = 2 * i; a < 2 * i + 2; ++a) {
        const double d = along(y, a), w = along(v, a);
        force[a] += d * pull[i];
        if (a >= 2) force[a - 2] -= d * pull[i];
        rate += d * w;
        second += w * w + d * along(yp + 2 * N, a);
      }
      r[4 * N + i] = index == 1 ? second : rate;
    }
  };
  keep(&p, 2 * N, [=](double, const double* y, double* g) {
    std::fill(g, g + 2 * N, 0.0);
    for (int a = 0; a < 2 * N; ++a) {
      const double d = along(y, a);
      g[a / 2] += d * d / 2;
      g[N + a / 2] += d * along(y + 2 * N, a);
    }
  });
  p.rows.back().constraints.jacobian =
      ida_projection::DenseJacobian{[=](double, ConstVector y, ida_projection::Matrix C) {
        C.setZero();
        for (int a = 0; a < 2 * N; ++a)
          for (const int end : {a, a - 2}) {
            if (end < 0) continue;
            const double sign = end == a ? 1.0 : -1.0;
            C(a / 2, end) = C(N + a / 2, 2 * N + end) = sign * along(y.data(), a);
            C(N + a / 2, end) = sign * along(y.data() + 2 * N, a);
          }
      }};
  return p;
}

}  // namespace

std::vector<problems::Problem> chains_of_rods() {
  constexpr double kReference = 1e-8;
  std::vector<problems::Problem> all = {
      rods("rods with bending springs", 1e6, 1, 0.3), rods("rods with softer springs", 1e5, 1, 0.3),
      rods("loose rods", 0.0, 1, 0.2), rods("loose rods", 0.0, 2, 0.2)};
  for (problems::Problem& p : all) {
    p.reference.assign(p.y0.size(), 0.0);
    Settings settings;
    settings.constraints = p.recommended_constraints();
    p.reference = p.index == 1 ? integrate(p, kReference, settings).y : all[2].reference;
  }
  return all;
}

std::vector<problems::Problem> others() {
  std::vector<problems::Problem> all = {arm(),          titration(), circular_orbit(),
                                        three_bodies(), top(),       toda()};
  for (problems::Problem& p : all) {
    p.reference.assign(p.y0.size(), 0.0);
    p.reference = integrate(p, 1e-12).y;
  }
  return all;
}

}  // namespace tether::bench
