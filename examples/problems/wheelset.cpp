// Tether: wheelset of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <problems/dual.hpp>
#include <problems/wheelset.hpp>

namespace tether::problems {

namespace {

constexpr double kMass = 16.08, kGravity = 9.81, kSpeed = 30.0, kRadius = 0.1,
                 kSpinInertia = 0.0605, kYawInertia = 0.366, kFriction = 0.12, kSpringArm = 0.19,
                 kStiffness = 6400.0;
constexpr double kSpin = kSpeed / kRadius, kCone = 0.0262, kGauge = 0.1506, kRail = 0.06;
// Kalker's coefficients and the contact ellipse; the published code has this pi.
constexpr double kEllipse = 1.3537956, kAxes = 0.7115218, kPoisson = 0.28, kShear = 7.92e10,
                 kC11 = 4.72772197, kC22 = 4.27526987, kC23 = 1.97203505, kPi = 3.1415926;
constexpr double kForceUnit = 1e4;  // of the multipliers
constexpr int kSize = 17, kRight = 11, kLeft = 13, kForces = 15;

template <class S>
struct Angle {
  S sine, cosine;
  explicit Angle(S angle) {
    using std::cos;
    using std::sin;
    sine = sin(angle);
    cosine = cos(angle);
  }
};

/// One wheel on its rail, by the angle and the offset of the contact.
template <class S>
struct Contact {
  Angle<S> yaw, roll, around;
  S offset, radius, slope;          // of the wheel: a cone
  S height, rail_slope, rail_bend;  // of the rail: a circle, with two derivatives

  Contact(const S* y, const S* contact)
      : yaw(y[3]), roll(y[4]), around(contact[0]), offset(contact[1]) {
    using std::sqrt;
    const double side = offset > S(0.0) ? 1.0 : -1.0;
    radius = kRadius + std::tan(kCone) * (kGauge - side * offset);
    slope = S(-side * std::tan(kCone));
    const S across = y[0] + offset * yaw.cosine * roll.cosine +
                     radius * (yaw.cosine * roll.sine * around.cosine - yaw.sine * around.sine);
    const double rail_side = across > S(0.0) ? 1.0 : -1.0;
    const S from_top = rail_side * across - (kGauge + kRail * std::sin(kCone));
    const S rise = sqrt(kRail * kRail - from_top * from_top);
    height = rise - kRadius - std::cos(kCone) * kRail;
    rail_slope = -rail_side * from_top / rise;
    rail_bend = -kRail * kRail / (rise * rise * rise);
  }

  S distance(const S* y) const {
    return height - y[1] - offset * roll.sine + radius * roll.cosine * around.cosine;
  }

  /// Derivative of `distance` to the five coordinates.
  void direction(S* q) const {
    const S &st = yaw.sine, &ct = yaw.cosine, &sf = roll.sine, &cf = roll.cosine;
    const S &sp = around.sine, &cp = around.cosine;
    q[0] = rail_slope;
    q[1] = S(-1.0);
    q[2] = S(0.0);
    q[3] = -rail_slope * (radius * (ct * sp + cp * sf * st) + cf * st * offset);
    q[4] = rail_slope * ct * (cf * cp * radius - sf * offset) - cp * radius * sf - cf * offset;
  }

  /// The wheel's normal is the rail's: 0, 0.
  void tangency(S* g) const {
    const S &st = yaw.sine, &ct = yaw.cosine, &sf = roll.sine, &cf = roll.cosine;
    const S &sp = around.sine, &cp = around.cosine;
    g[0] = rail_slope * (slope * sf + cf * cp) + slope * ct * cf - ct * sf * cp + st * sp;
    g[1] = slope * st * cf - st * sf * cp - ct * sp;
  }
};

struct Frame {
  double sine, cosine;  // of the tangent plane's angle; opposite sides have opposite sines

  explicit Frame(const Contact<double>& at) {
    const double across =
        (at.slope * at.roll.cosine - at.roll.sine * at.around.cosine) * at.yaw.cosine +
        at.around.sine * at.yaw.sine;
    const double up = at.slope * at.roll.sine + at.around.cosine * at.roll.cosine;
    const double angle = -std::atan(across / up);
    sine = std::sin(angle);
    cosine = std::cos(angle);
  }
};

// Creep forces of one contact (lateral, vertical, longitudinal) under its normal force.
void creep(const Contact<double>& at, const Frame& plane, const double* y, double normal,
           double* force) {
  const double *rate = y + 5, spin = kSpin + y[10], r = at.radius, x = at.offset;
  const double yaw = y[3] / plane.cosine, st = std::sin(yaw), ct = std::cos(yaw);
  const double sf = at.roll.sine, cf = at.roll.cosine, sp = at.around.sine, cp = at.around.cosine;
  const double lever = x * sf - r * cf * cp;
  const double slip[3] = {
      rate[0] - spin * r * (st * cp + ct * sf * sp) -
          rate[3] * (r * (st * sf * cp + ct * sp) + x * st * cf) - rate[4] * ct * lever,
      rate[1] + spin * r * cf * sp + rate[4] * (x * cf + r * sf * cp),
      rate[2] + kSpeed - spin * r * (ct * cp - st * sf * sp) -
          rate[3] * (x * ct * cf + r * (ct * sf * cp - st * sp)) + rate[4] * st * lever};
  const double rolling = 0.5 * std::hypot(slip[0] - 2.0 * rate[0], slip[1] - 2.0 * rate[1],
                                          slip[2] - 2.0 * rate[2] - 2.0 * kSpeed);
  const double along = (st * slip[0] + ct * slip[2]) / rolling;
  const double sideways =
      (plane.cosine * (ct * slip[0] - st * slip[2]) + plane.sine * slip[1]) / rolling;
  const double turning = (plane.cosine * rate[3] - plane.sine * spin) / rolling;

  const double wheel = 0.5 / (r * std::sqrt(1.0 + at.slope * at.slope));
  const double rail = -0.5 * at.rail_bend / std::pow(1.0 + at.rail_slope * at.rail_slope, 1.5);
  const double size = std::cbrt(3.0 * std::abs(normal) * (1.0 - kPoisson) * kEllipse /
                                (2.0 * kPi * (wheel + rail) * kShear * std::sqrt(kAxes)));
  const double most = kFriction * normal, scale = kShear * size * size / most;
  double tx = -most * std::tanh(scale * kC11 * along);
  double ty = -most * std::tanh(scale * (kC22 * sideways + size * kC23 * turning));
  const double together = std::hypot(tx, ty);
  if (together > std::abs(most)) {
    tx *= std::abs(most) / together;
    ty *= std::abs(most) / together;
  }
  force[0] = st * tx + ct * plane.cosine * ty;
  force[1] = plane.sine * ty;
  force[2] = ct * tx - st * plane.cosine * ty;
}

// The right sides of the six equations of motion.
void forces(const double* y, double* f) {
  const Contact<double> contacts[2] = {{y, y + kLeft}, {y, y + kRight}};
  const Frame planes[2] = {Frame(contacts[0]), Frame(contacts[1])};
  double directions[2][5];
  double across = 0.0, up = 0.0;
  for (int k = 0; k < 2; ++k) {
    contacts[k].direction(directions[k]);
    across += directions[k][0] * y[kForces + k] * kForceUnit;
    up += directions[k][1] * y[kForces + k] * kForceUnit;
  }
  const double determinant = planes[1].sine * planes[0].cosine - planes[0].sine * planes[1].cosine;
  const double normal[2] = {(planes[1].cosine * across + planes[1].sine * up) / determinant,
                            -(planes[0].cosine * across + planes[0].sine * up) / determinant};

  const double sf = contacts[0].roll.sine, cf = contacts[0].roll.cosine;
  const double st = contacts[0].yaw.sine, ct = contacts[0].yaw.cosine;
  const double yaw = y[8], roll = y[9], spin = kSpin + y[10];
  const double yaw_moment = -2.0 * kSpringArm * kSpringArm * kStiffness * y[3];
  const double difference = (kSpinInertia - kYawInertia) * yaw * sf;
  f[0] = -2.0 * kStiffness * y[0];
  f[1] = -kMass * kGravity;
  f[2] = -2.0 * kStiffness * y[2];
  f[3] = kYawInertia * yaw * roll * sf - kSpinInertia * spin * roll - difference * roll +
         cf * yaw_moment;
  f[4] = kSpinInertia * spin * yaw * cf + difference * yaw * cf;
  f[5] = -kSpinInertia * yaw * roll * cf + sf * yaw_moment;
  for (int k = 0; k < 2; ++k) {
    const Contact<double>& at = contacts[k];
    const double r = at.radius, x = at.offset, sp = at.around.sine, cp = at.around.cosine;
    double T[3];
    creep(at, planes[k], y, normal[k], T);
    for (int i = 0; i < 3; ++i) f[i] += T[i];
    f[3] += -(x * st + r * sp * ct * cf) * T[0] - r * sp * sf * T[1] +
            (r * sp * st * cf - x * ct) * T[2];
    f[4] += (r * cp * ct * cf - x * ct * sf) * T[0] + (x * cf + r * cp * sf) * T[1] +
            (x * st * sf - r * cp * st * cf) * T[2];
    f[5] += -r * (cp * st + sp * ct * sf) * T[0] + r * sp * cf * T[1] -
            r * (cp * ct - sp * st * sf) * T[2];
    for (int i = 0; i < 5; ++i) f[i] += directions[k][i] * y[kForces + k] * kForceUnit;
  }
}

// Distances of the left contact and of the right one, their rates, tangency of each.
template <class S>
void contact_rows(const S* y, S* g) {
  const int places[2] = {kLeft, kRight};
  for (int k = 0; k < 2; ++k) {
    const Contact<S> at(y, y + places[k]);
    g[k] = at.distance(y);
    S q[5];
    at.direction(q);
    g[2 + k] = S(0.0);
    for (int i = 0; i < 5; ++i) g[2 + k] += q[i] * y[5 + i];
    at.tangency(g + 4 + 2 * k);
  }
}

// v' and the spin's rate.
void accelerations(const double* y, double* a) {
  double f[6];
  forces(y, f);
  for (int i = 0; i < 3; ++i) a[i] = f[i] / kMass;
  a[3] = f[3] / (kYawInertia * std::cos(y[4]));
  a[4] = f[4] / kYawInertia;
  a[5] = f[5] / kSpinInertia - std::sin(y[4]) * a[3];
}

// The multipliers with which contacts at rest stay contacts: Newton by differences.
void balance_contacts(double* y) {
  const auto second_rates = [](const double* at) {
    double a[6], moving[kSize];
    accelerations(at, a);
    std::copy(at, at + kSize, moving);
    std::copy(a, a + 5, moving + 5);
    double g[8];
    contact_rows(moving, g);
    return Eigen::Vector2d(g[2], g[3]);
  };
  for (int iteration = 0; iteration < 8; ++iteration) {
    const Eigen::Vector2d g = second_rates(y);
    Eigen::Matrix2d J;
    for (int k = 0; k < 2; ++k) {
      const double at = y[kForces + k], step = 1e-6 * at;
      y[kForces + k] = at + step;
      J.col(k) = (second_rates(y) - g) / step;
      y[kForces + k] = at;
    }
    Eigen::Map<Eigen::Vector2d>(y + kForces) -= J.partialPivLu().solve(g);
  }
}

}  // namespace

Problem wheelset() {
  std::vector<double> y0 = {0.14941e-2,
                            0.40089e-6,
                            0.11241e-5,
                            -0.28573e-3,
                            0.26459e-3,
                            0,
                            0,
                            0,
                            0,
                            0,
                            0,
                            -7.4122380357667139e-06,
                            -0.1521364296121248,
                            7.5634406395172940e-06,
                            0.1490635714733819,
                            -8.3593e-3,
                            -7.4144e-3},
                      yp0(kSize, 0.0), id(kSize, 0.0);
  balance_contacts(y0.data());
  accelerations(y0.data(), yp0.data() + 5);
  std::fill(id.begin(), id.begin() + 11, 1.0);
  Problem p = start_problem("wheelset", "index 2", 2, 10.0, y0, yp0, id);
  p.error_components = 11;
  p.variable_index.assign(kSize, 1);
  std::fill(p.variable_index.begin() + kForces, p.variable_index.end(), 2);
  p.residual = [](double, const double* y, const double* yp, double* r) {
    double f[6], g[8];
    forces(y, f);
    contact_rows(y, g);
    for (int i = 0; i < 5; ++i) r[i] = yp[i] - y[5 + i];
    for (int i = 0; i < 3; ++i) r[5 + i] = kMass * yp[5 + i] - f[i];
    r[8] = kYawInertia * std::cos(y[4]) * yp[8] - f[3];
    r[9] = kYawInertia * yp[9] - f[4];
    r[10] = kSpinInertia * (std::sin(y[4]) * yp[8] + yp[10]) - f[5];
    std::copy(g + 2, g + 8, r + 11);
  };
  double start[8];
  contact_rows(y0.data(), start);
  p.rows.push_back(
      rows_of_values("contacts",
                     {"left", "right", "left rate", "right rate", "left across", "left along",
                      "right across", "right along"},
                     kSize, [left = start[0], right = start[1]](double, const auto* y, auto* g) {
                       contact_rows(y, g);
                       g[0] -= left;
                       g[1] -= right;
                     }));
  p.recommended = {"contacts"};
  // IDA and DASPK at 1e-12, without and with projection; the published end (DASSL at 1e-9) is off
  // by 1e-7.
  p.reference = {8.6355382504e-3,  1.303834150e-5,    -9.36358115e-5,  -1.3642295966e-2,
                 1.52928942134e-3, -7.698524110e-2,   -2.51510637e-4,  2.0541148830e-3,
                 -0.2390484027,    -1.36334448790e-2, -0.2442137057,   -3.36667426e-4,
                 -0.159494256374,  3.78396036361e-4,  0.1417321500975, -1.0124044997e-2,
                 -5.6285629058e-3};
  return p;
}

}  // namespace tether::problems
