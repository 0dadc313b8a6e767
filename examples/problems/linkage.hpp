// Tether: planar rods held together by pins, in any arrangement. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <problems/problem.hpp>
#include <string>
#include <vector>

namespace tether::problems {

constexpr double kRodGravity = 9.81;
constexpr int kGround = -1;

struct Rod {
  double mass, length;
  double inertia() const { return mass * length * length / 12.0; }
};

/// A point of rod a, `at_a` metres from its centre along the rod, coincides with a point of rod b,
/// or with (x, y) when b is the ground.
struct Pin {
  int a;
  double at_a;
  int b;
  double at_b;
  double x, y;
};

/// Constants only; shared by the callbacks. q: x, y of the centre and angle of each rod.
struct Linkage {
  std::vector<Rod> rods;
  std::vector<Pin> pins;

  int n() const { return 3 * static_cast<int>(rods.size()); }
  int m() const { return 2 * static_cast<int>(pins.size()); }
  int size() const { return 2 * n() + m(); }  // of the form "index 1"

  // Both ends of every pin: f(row of x, rod, signed distance along the rod); b counts negative.
  template <class F>
  void each_end(F f) const {
    int row = 0;
    for (const Pin& pin : pins) {
      f(row, pin.a, pin.at_a, 1.0);
      if (pin.b != kGround) f(row, pin.b, pin.at_b, -1.0);
      row += 2;
    }
  }

  // Writes what pins to the ground contribute to `position`.
  void position_of_ground(double* r) const {
    int row = 0;
    for (const Pin& pin : pins) {
      r[row] = pin.b == kGround ? -pin.x : 0.0;
      r[row + 1] = pin.b == kGround ? -pin.y : 0.0;
      row += 2;
    }
  }

  void position(const double* q, double* r) const {
    position_of_ground(r);
    each_end([&](int i, int rod, double at, double sign) {
      const double* c = q + 3 * rod;
      r[i] += sign * (c[0] + at * std::cos(c[2]));
      r[i + 1] += sign * (c[1] + at * std::sin(c[2]));
    });
  }

  void velocity(const double* q, const double* v, double* r) const {
    std::fill(r, r + m(), 0.0);
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2], turn = v[3 * rod + 2];
      r[i] += sign * (v[3 * rod] - at * std::sin(angle) * turn);
      r[i + 1] += sign * (v[3 * rod + 1] + at * std::cos(angle) * turn);
    });
  }

  void acceleration(const double* q, const double* v, const double* a, double* r) const {
    std::fill(r, r + m(), 0.0);
    each_end([&](int i, int rod, double at, double sign) {
      const double s = at * std::sin(q[3 * rod + 2]), c = at * std::cos(q[3 * rod + 2]);
      const double turn2 = v[3 * rod + 2] * v[3 * rod + 2], second = a[3 * rod + 2];
      r[i] += sign * (a[3 * rod] - s * second - c * turn2);
      r[i + 1] += sign * (a[3 * rod + 1] + c * second - s * turn2);
    });
  }

  // set(row, column, entry) for the entries of dg/dq.
  template <class Set>
  void gradient(const double* q, Set set) const {
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2];
      set(i, 3 * rod, sign);
      set(i + 1, 3 * rod + 1, sign);
      set(i, 3 * rod + 2, -sign * at * std::sin(angle));
      set(i + 1, 3 * rod + 2, sign * at * std::cos(angle));
    });
  }

  // The same for the derivative of velocity to q.
  template <class Set>
  void velocity_gradient(const double* q, const double* v, Set set) const {
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2], turn = v[3 * rod + 2];
      set(i, 3 * rod + 2, -sign * at * std::cos(angle) * turn);
      set(i + 1, 3 * rod + 2, -sign * at * std::sin(angle) * turn);
    });
  }

  double mass(int coordinate) const {
    const Rod& rod = rods[static_cast<std::size_t>(coordinate / 3)];
    return coordinate % 3 == 2 ? rod.inertia() : rod.mass;
  }
  double force(int coordinate) const {
    return coordinate % 3 == 1 ? -mass(coordinate) * kRodGravity : 0.0;
  }

  // r = M a - f + G^T lam
  void dynamics(const double* q, const double* a, const double* lam, double* r) const {
    for (int i = 0; i < n(); ++i) r[i] = mass(i) * a[i] - force(i);
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2];
      r[3 * rod] += sign * lam[i];
      r[3 * rod + 1] += sign * lam[i + 1];
      r[3 * rod + 2] += sign * at * (std::cos(angle) * lam[i + 1] - std::sin(angle) * lam[i]);
    });
  }

  // add(row, column, entry) for the entries of dF/dy + cj dF/dy' of the form "index 1", in an order
  // that does not depend on the values.
  template <class Add>
  void derivatives(double epsilon, double cj, const double* y, const double* yp, Add add) const {
    const int nq = n();
    for (int i = 0; i < nq; ++i) {
      add(i, i, cj);
      add(i, nq + i, -1.0);
      add(nq + i, nq + i, cj * mass(i));
    }
    for (int i = 2 * nq; i < size(); ++i) add(i, i, -epsilon);
    gradient(y, [&](int i, int j, double entry) {
      add(2 * nq + i, nq + j, cj * entry);
      add(nq + j, 2 * nq + i, entry);
    });
    velocity_gradient(y, y + nq,
                      [&](int i, int j, double entry) { add(2 * nq + i, nq + j, 2.0 * entry); });
    each_end([&](int i, int rod, double distance, double sign) {
      const int angle = 3 * rod + 2;
      const double s = sign * distance * std::sin(y[angle]);
      const double c = sign * distance * std::cos(y[angle]);
      const double turn2 = y[nq + angle] * y[nq + angle], second = yp[nq + angle];
      add(2 * nq + i, angle, -c * second + s * turn2);
      add(2 * nq + i + 1, angle, -s * second - c * turn2);
      add(nq + angle, angle, -c * y[2 * nq + i] - s * y[2 * nq + i + 1]);
    });
  }

  double energy(const double* q, const double* v) const {
    double sum = 0.0;
    for (int i = 0; i < n(); ++i) sum += mass(i) * v[i] * v[i] / 2.0 - force(i) * q[i];
    return sum;
  }
};

using LinkagePointer = std::shared_ptr<const Linkage>;

/// The linkage in a form of pinned_rods.hpp, without reference. q0, v0 must be consistent.
Problem build(const std::string& name, const LinkagePointer& linkage, const std::string& form,
              double epsilon, double t_end, const std::vector<double>& q0,
              const std::vector<double>& v0);

/// q and v at the end; the multipliers stay unknown.
void set_reference(const std::vector<double>& q, const std::vector<double>& v, Problem* p);

/// Accelerations and multipliers of 0 = M a - f + G^T lam, g'' = epsilon lam. Above 600 rows, with
/// epsilon = 0, these must be independent.
void solve_motion(const Linkage& linkage, double epsilon, const double* q, const double* v,
                  std::vector<double>* a, std::vector<double>* lam);

}  // namespace tether::problems
