// Tether: torque-free rigid body. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/reference.hpp>
#include <problems/rigid_body.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

constexpr double kInertia[3] = {1.0, 2.0, 3.0};

// q' = q (0, w)/2, I w' = I w x w.
template <class Real, class State, class Rate>
void motion_rate(const State& y, Rate& dy) {
  const Real half = Real(1) / Real(2), third = Real(1) / Real(3);
  dy[0] = half * (-y[1] * y[4] - y[2] * y[5] - y[3] * y[6]);
  dy[1] = half * (y[0] * y[4] + y[2] * y[6] - y[3] * y[5]);
  dy[2] = half * (y[0] * y[5] + y[3] * y[4] - y[1] * y[6]);
  dy[3] = half * (y[0] * y[6] + y[1] * y[5] - y[2] * y[4]);
  dy[4] = -y[5] * y[6];
  dy[5] = y[6] * y[4];
  dy[6] = -third * y[4] * y[5];
}

// q v q*, |q|^2 times the rotated vector.
void rotate(const double* q, const double* v, double* out) {
  const double scalar = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] - q[3] * q[3];
  const double along = 2.0 * (q[1] * v[0] + q[2] * v[1] + q[3] * v[2]);
  out[0] = scalar * v[0] + along * q[1] + 2.0 * q[0] * (q[2] * v[2] - q[3] * v[1]);
  out[1] = scalar * v[1] + along * q[2] + 2.0 * q[0] * (q[3] * v[0] - q[1] * v[2]);
  out[2] = scalar * v[2] + along * q[3] + 2.0 * q[0] * (q[1] * v[1] - q[2] * v[0]);
}

void momentum_gradient(const double* y, double* C) {
  const double* q = y;
  const double* u = y + 1;  // vector part
  const double L[3] = {kInertia[0] * y[4], kInertia[1] * y[5], kInertia[2] * y[6]};
  const double cross[3] = {u[1] * L[2] - u[2] * L[1], u[2] * L[0] - u[0] * L[2],
                           u[0] * L[1] - u[1] * L[0]};
  const double skew[3][3] = {{0.0, -L[2], L[1]}, {L[2], 0.0, -L[0]}, {-L[1], L[0], 0.0}};
  const double dot = u[0] * L[0] + u[1] * L[1] + u[2] * L[2];
  for (int i = 0; i < 3; ++i) {
    C[7 * i] = 2.0 * (q[0] * L[i] + cross[i]);
    for (int j = 0; j < 3; ++j)
      C[7 * i + 1 + j] =
          2.0 * (u[i] * L[j] - L[i] * u[j] - q[0] * skew[i][j] + (i == j ? dot : 0.0));
  }
  for (int j = 0; j < 3; ++j) {
    double axis[3] = {0.0, 0.0, 0.0}, column[3];
    axis[j] = kInertia[j];
    rotate(q, axis, column);
    for (int i = 0; i < 3; ++i) C[7 * i + 4 + j] = column[i];
  }
}

}  // namespace

std::vector<std::string> rigid_body_motions() { return {"regular", "euler", "dzhanibekov"}; }

Problem rigid_body(const std::string& motion, double t_end) {
  std::array<double, 3> w0{};
  if (motion == "regular")
    w0 = {1.0, 0.0, 1.0};
  else if (motion == "euler")
    w0 = {1.0, 1.0, 1.0};
  else if (motion == "dzhanibekov")
    w0 = {0.01, 1.0, 0.0};
  else
    unknown_form("rigid body", motion, rigid_body_motions());

  Problem p;
  p.name = "rigid body, " + motion;
  p.form = "index 0";
  p.index = 0;
  p.size = 7;
  p.t_end = t_end;
  p.y0 = {1.0, 0.0, 0.0, 0.0, w0[0], w0[1], w0[2]};
  p.yp0.resize(7);
  motion_rate<double>(p.y0, p.yp0);
  p.id.assign(7, 1.0);
  p.error_components = 7;
  p.residual = [](double, const double* y, const double* yp, double* r) {
    motion_rate<double>(y, r);
    for (int i = 0; i < 7; ++i) r[i] = yp[i] - r[i];
  };
  p.jacobian = [](double, double cj, const double* y, const double*, double* J) {
    std::fill(J, J + 49, 0.0);
    const auto add = [J](int row, int column, double entry) { J[row + 7 * column] += entry; };
    for (int i = 0; i < 7; ++i) add(i, i, cj);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      add(0, 1 + i, 0.5 * y[4 + i]);
      add(0, 4 + i, 0.5 * y[1 + i]);
      add(1 + i, 0, -0.5 * y[4 + i]);
      add(1 + i, 4 + i, -0.5 * y[0]);
      add(1 + i, 1 + j, -0.5 * y[4 + k]);
      add(1 + i, 4 + k, -0.5 * y[1 + j]);
      add(1 + i, 1 + k, 0.5 * y[4 + j]);
      add(1 + i, 4 + j, 0.5 * y[1 + k]);
      const double factor = (kInertia[j] - kInertia[k]) / kInertia[i];
      add(4 + i, 4 + j, -factor * y[4 + k]);
      add(4 + i, 4 + k, -factor * y[4 + j]);
    }
  };

  p.rows.push_back(make_rows(
      "quaternion norm", {"quaternion norm"},
      [](double, const double* y, double* r) {
        r[0] = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3] - 1.0) / 2.0;
      },
      [](double, const double* y, double* C) { std::copy(y, y + 4, C); }));
  double twice = 0.0;
  std::array<double, 3> L{};
  for (std::size_t i = 0; i < 3; ++i) {
    twice += kInertia[i] * w0[i] * w0[i];
    L[i] = kInertia[i] * w0[i];
  }
  p.rows.push_back(make_rows(
      "energy", {"twice the kinetic energy"},
      [twice](double, const double* y, double* r) {
        r[0] = -twice;
        for (int i = 0; i < 3; ++i) r[0] += kInertia[i] * y[4 + i] * y[4 + i];
      },
      [](double, const double* y, double* C) {
        for (int i = 0; i < 3; ++i) C[4 + i] = 2.0 * kInertia[i] * y[4 + i];
      }));
  p.rows.push_back(make_rows(
      "angular momentum", {"angular momentum x", "angular momentum y", "angular momentum z"},
      [L](double, const double* y, double* r) {
        const double body[3] = {kInertia[0] * y[4], kInertia[1] * y[5], kInertia[2] * y[6]};
        rotate(y, body, r);
        for (std::size_t i = 0; i < 3; ++i) r[i] -= L[i];
      },
      [](double, const double* y, double* C) { momentum_gradient(y, C); }));
  p.recommended = {"quaternion norm", "energy", "angular momentum"};

  using State = std::array<long double, 7>;
  const State end =
      reference_solution<7>([](const State& y, State& dy) { motion_rate<long double>(y, dy); },
                            State{1.0L, 0.0L, 0.0L, 0.0L, w0[0], w0[1], w0[2]}, t_end);
  p.reference.assign(end.begin(), end.end());
  return p;
}

}  // namespace tether::problems
