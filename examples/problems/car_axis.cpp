// Tether: car axis of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/car_axis.hpp>
#include <problems/mechanism.hpp>

namespace tether::problems {

namespace {

constexpr double kLength = 1.0, kSpringLength = 0.5, kRoad = 0.1, kFrequency = 10.0;
constexpr double kGravity = 1.0, kMass = 10.0 * 1e-2 * 1e-2 / 2.0;

// The right wheel's road: yb = r sin(w t), xb = sqrt(L^2 - yb^2), with two derivatives of each.
struct Road {
  double x, y, dx, dy, ddx, ddy;

  explicit Road(double t) {
    const double s = std::sin(kFrequency * t), c = std::cos(kFrequency * t);
    y = kRoad * s;
    dy = kRoad * kFrequency * c;
    ddy = -kRoad * kFrequency * kFrequency * s;
    x = std::sqrt(kLength * kLength - y * y);
    dx = -y * dy / x;
    ddx = -(dy * dy + y * ddy + dx * dx) / x;
  }
};

struct CarAxis {
  static constexpr int n = 4, m = 2;
  static constexpr double sign = -1.0;  // the published equations have + G^T lam

  void mass(const double*, double* M) const {
    for (int i = 0; i < 4; ++i) M[5 * i] = kMass;
  }

  void force(double t, const double* q, const double*, double* f) const {
    const Road b(t);
    spring(q[0], q[1], f);
    spring(q[2] - b.x, q[3] - b.y, f + 2);
    f[1] -= kMass * kGravity;
    f[3] -= kMass * kGravity;
  }

  void position(double t, const double* q, double* r) const { position_of(Road(t), q, r); }
  void gradient(double t, const double* q, double* G) const { gradient_of(Road(t), q, G); }
  void velocity(double t, const double* q, const double* v, double* r) const {
    velocity_of(Road(t), q, v, r);
  }
  void velocity_gradient(double t, const double*, const double* v, double* H) const {
    velocity_gradient_of(Road(t), v, H);
  }
  void position_with_gradient(double t, const double* q, double* r, double* G) const {
    const Road b(t);
    position_of(b, q, r);
    gradient_of(b, q, G);
  }
  void velocity_with_gradients(double t, const double* q, const double* v, double* r, double* G,
                               double* H) const {
    const Road b(t);
    velocity_of(b, q, v, r);
    gradient_of(b, q, G);
    velocity_gradient_of(b, v, H);
  }

  static void position_of(const Road& b, const double* q, double* r) {
    const double dx = q[0] - q[2], dy = q[1] - q[3];
    r[0] = b.x * q[0] + b.y * q[1];
    r[1] = dx * dx + dy * dy - kLength * kLength;
  }

  static void gradient_of(const Road& b, const double* q, double* G) {
    G[0] = b.x;
    G[1] = b.y;
    axle(q, G + 4);
  }

  static void velocity_of(const Road& b, const double* q, const double* v, double* r) {
    r[0] = b.x * v[0] + b.y * v[1] + b.dx * q[0] + b.dy * q[1];
    r[1] = 2.0 * ((q[0] - q[2]) * (v[0] - v[2]) + (q[1] - q[3]) * (v[1] - v[3]));
  }

  static void velocity_gradient_of(const Road& b, const double* v, double* H) {
    H[0] = b.dx;
    H[1] = b.dy;
    axle(v, H + 4);
  }

  void acceleration(double t, const double* q, const double* v, const double* a, double* r) const {
    const Road b(t);
    const double ux = v[0] - v[2], uy = v[1] - v[3];
    r[0] =
        b.x * a[0] + b.y * a[1] + 2.0 * (b.dx * v[0] + b.dy * v[1]) + b.ddx * q[0] + b.ddy * q[1];
    r[1] =
        2.0 * ((q[0] - q[2]) * (a[0] - a[2]) + (q[1] - q[3]) * (a[1] - a[3]) + ux * ux + uy * uy);
  }

  void acceleration_gradient(double t, const double*, const double*, const double* a,
                             double* K) const {
    const Road b(t);
    K[0] = b.ddx;
    K[1] = b.ddy;
    axle(a, K + 4);
  }

  void dynamics_gradient(double t, const double* q, const double*, const double*, const double* lam,
                         double* Dq, double*) const {
    const Road b(t);
    spring_gradient(q[0], q[1], Dq);
    spring_gradient(q[2] - b.x, q[3] - b.y, Dq + 10);
    const double axle_force = 2.0 * lam[1];  // s (G^T lam)_q
    for (int i = 0; i < 2; ++i) {
      Dq[5 * i] -= axle_force;
      Dq[5 * i + 2] += axle_force;
      Dq[5 * i + 8] += axle_force;
      Dq[5 * i + 10] -= axle_force;
    }
  }

 private:
  static void axle(const double* u, double* row) {
    row[0] = 2.0 * (u[0] - u[2]);
    row[1] = 2.0 * (u[1] - u[3]);
    row[2] = -row[0];
    row[3] = -row[1];
  }

  static void spring(double x, double y, double* f) {
    const double length = std::sqrt(x * x + y * y);
    const double factor = (kSpringLength - length) / length;
    f[0] = factor * x;
    f[1] = factor * y;
  }

  // -df/d(x, y) in rows of length 4; f = (L0/l - 1) (x, y).
  static void spring_gradient(double x, double y, double* D) {
    const double length = std::sqrt(x * x + y * y);
    const double factor = (kSpringLength - length) / length;
    const double slope = kSpringLength / (length * length * length);
    D[0] = -factor + slope * x * x;
    D[1] = slope * x * y;
    D[4] = slope * x * y;
    D[5] = -factor + slope * y * y;
  }
};

}  // namespace

std::vector<std::string> car_axis_forms() { return Mechanism<CarAxis>::forms(); }

Problem car_axis(const std::string& form) {
  Problem p = Mechanism<CarAxis>::make(CarAxis{}, "car axis", form, {0.0, 0.5, 1.0, 0.5},
                                       {-0.5, 0.0, -0.5, 0.0}, {"road", "axle"});
  p.t_end = 3.0;
  // GAMD in quadruple precision, from the R package deTestSet.
  const std::vector<double> q{0.493455784275402809122e-1, 0.496989460230171153861,
                              0.104174252488542151681e1, 0.373911027265361256927};
  const std::vector<double> v{-0.770583684040972357970e-1, 0.744686658723778553466e-2,
                              0.175568157537232222276e-1, 0.770341043779251976443};
  const std::vector<double> lam{-0.473688659084893324729e-2, -0.110468033125734368808e-2};
  Mechanism<CarAxis>::set_reference(CarAxis{}, q, v, lam, p);
  p.error_components = 8;
  return p;
}

}  // namespace tether::problems
