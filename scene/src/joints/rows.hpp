// Tether: the rows that joints are made of. SPDX-License-Identifier: BSD-3-Clause
//
// Each kind of row has
//   rows<order>(A, B, g)        the order-th time derivative of its g
//   pull(A, B, lambda, a, b)    adds G^T lambda to the wrenches of its two bodies
//   rate_by_time(g_t)           the part of the velocity row that does not come from velocities
// A row is the sum of its parts where several have its number (Relation).
// for any scalar, so that the derivatives come from the same formulas. `first` and `second` index
// the frames of the bodies, `row` is the first row, `measures` tells a g in m from one in rad.
#pragma once

#include "coordinate.hpp"
#include "mechanics/frames.hpp"
#include "toml/form.hpp"

namespace tether::scene::joints {

/// The value of a motion and its derivatives at one time.
struct Now {
  double s = 0, s1 = 0, s2 = 0;
};

Now evaluate(const Motion& motion, double t);

/// The fields of motion = {...}; `angle`: in rad or degrees, else in m.
void motion_fields(const files::Form& form, bool angle, Motion& motion);

using namespace mechanics;

struct Row {
  int first = 0, second = 0, row = 0, joint = 0;
  int place_first = 0, place_second = 0;  // of its moving bodies, by slot
};

/// A point of the first body coincides with a point of the second: 3 rows.
struct Coincidence : Row {
  static constexpr int count = 3;
  static constexpr MotionOf measures = MotionOf::length;
  Vector3d at_first, at_second;

  template <int order, class S>
  void rows(const Frame<S>& A, const Frame<S>& B, S* g) const {
    const Jet<S> d = between<order>(A, at_first, B, at_second);
    const Vector3<S>& now = order == 0 ? d.x : order == 1 ? d.x1 : d.x2;
    for (int i = 0; i < 3; ++i) g[i] = now[i];
  }
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const double* lambda, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    const Vector3<S> force = {S(lambda[0]), S(lambda[1]), S(lambda[2])};
    add_opposite(A, point<0>(A, at_first).x, B, point<0>(B, at_second).x, force, on_first,
                 on_second);
  }
  void rate_by_time(double* g_t) const { g_t[0] = g_t[1] = g_t[2] = 0.0; }
};

/// A direction of the first body stays at right angles to one of the second.
struct RightAngle : Row {
  static constexpr int count = 1;
  static constexpr MotionOf measures = MotionOf::angle;
  Vector3d of_first, of_second;

  template <int order, class S>
  void rows(const Frame<S>& A, const Frame<S>& B, S* g) const {
    g[0] = product<order>(direction<order>(A, of_first), direction<order>(B, of_second));
  }
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const double* lambda, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    turn(times(A.R, of_first), times(B.R, of_second), lambda[0], on_first, on_second);
  }
  void rate_by_time(double* g_t) const { g_t[0] = 0.0; }

  template <class S>
  static void turn(const Vector3<S>& u, const Vector3<S>& v, double lambda, Wrench<S>& on_first,
                   Wrench<S>& on_second) {
    const Vector3<S> axis = cross(u, v);
    for (int i = 0; i < 3; ++i) {
      const S torque(axis[i] * lambda);
      on_first.torque[i] += torque;
      on_second.torque[i] -= torque;
    }
  }
};

/// A direction of the first body has turned by the angle s against `zero` of the second, about the
/// axis zero x ahead: sin(angle - s) = 0.
struct Angle : Row {
  static constexpr int count = 1;
  static constexpr MotionOf measures = MotionOf::angle;
  Vector3d of_first, zero, ahead;
  const Now* now = nullptr;

  Vector3d normal() const { return std::cos(now->s) * ahead - std::sin(now->s) * zero; }
  Vector3d tangent() const { return -std::cos(now->s) * zero - std::sin(now->s) * ahead; }

  template <int order, class S>
  void rows(const Frame<S>& A, const Frame<S>& B, S* g) const {
    const Vector3d n = normal(), t = tangent();
    g[0] = product<order>(direction<order>(A, of_first),
                          moving_direction<order>(B, n, Vector3d(now->s1 * t),
                                                  Vector3d(now->s2 * t - now->s1 * now->s1 * n)));
  }
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const double* lambda, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    RightAngle::turn(times(A.R, of_first), times(B.R, normal()), lambda[0], on_first, on_second);
  }
  // d/ds sin(angle - s) = -cos(angle - s) = -1 on the constraint.
  void rate_by_time(double* g_t) const { g_t[0] = -now->s1; }
};

/// The point of the first body stays in a plane of the second (or at distance s from it).
struct Plane : Row {
  static constexpr int count = 1;
  static constexpr MotionOf measures = MotionOf::length;
  Vector3d at_first, at_second, normal;  // normal: of the second body
  const Now* now = nullptr;              // null: s = 0

  template <int order, class S>
  void rows(const Frame<S>& A, const Frame<S>& B, S* g) const {
    const Jet<S> d = between<order>(A, at_first, B, at_second);
    g[0] = product<order>(direction<order>(B, normal), d);
    if (now) g[0] -= order == 0 ? now->s : order == 1 ? now->s1 : now->s2;
  }
  // The force acts on both bodies at the point of the first.
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const double* lambda, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    const Vector3<S> n = times(B.R, normal);
    const Vector3<S> force = {S(n[0] * lambda[0]), S(n[1] * lambda[0]), S(n[2] * lambda[0])};
    const Vector3<S> at = point<0>(A, at_first).x;
    add_opposite(A, at, B, at, force, on_first, on_second);
  }
  void rate_by_time(double* g_t) const { g_t[0] = now ? -now->s1 : 0.0; }
};

/// Two points stay at the distance L = length + s: (|d|^2 - L^2) / (2 length).
struct Distance : Row {
  static constexpr int count = 1;
  static constexpr MotionOf measures = MotionOf::length;
  Vector3d at_first, at_second;
  double length = 1;
  const Now* now = nullptr;  // null: s = 0

  template <int order, class S>
  void rows(const Frame<S>& A, const Frame<S>& B, S* g) const {
    const Jet<S> d = between<order>(A, at_first, B, at_second);
    const Now n = now ? *now : Now{};
    const double L = length + n.s;
    const double square = order == 0   ? L * L
                          : order == 1 ? 2.0 * L * n.s1
                                       : 2.0 * (n.s1 * n.s1 + L * n.s2);
    g[0] = product<order>(d, d);
    g[0] -= square;
    g[0] *= 0.5 / length;
  }
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const double* lambda, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    const Vector3<S> a = point<0>(A, at_first).x, b = point<0>(B, at_second).x;
    const double scale = lambda[0] / length;
    Vector3<S> force;
    for (int i = 0; i < 3; ++i) force[i] = (a[i] - b[i]) * scale;
    add_opposite(A, a, B, b, force, on_first, on_second);
  }
  void rate_by_time(double* g_t) const {
    g_t[0] = now ? -(length + now->s) * now->s1 / length : 0.0;
  }
};

/// A part of a coupling: a polynomial without a constant of one coordinate.
struct Relation : Row {
  static constexpr int count = 1;
  MotionOf measures = MotionOf::angle;
  Coordinate coordinate;
  std::vector<double> polynomial;  // from degree 1 on

  explicit Relation(const Coordinate& along) : coordinate(along) {}

  template <int order, class S>
  void rows(const Frame<S>& A, const Frame<S>& B, S* g) const {
    S s[order + 1];
    coordinate.derivatives<order>(A, B, s);
    if constexpr (order == 0) {
      g[0] = S(0.0);
      for (auto c = polynomial.rbegin(); c != polynomial.rend(); ++c) g[0] = S((g[0] + *c) * s[0]);
    } else {
      g[0] = S(slope(s[0]) * s[1]);
    }
    if constexpr (order == 2) {
      g[0] = S(slope(s[0]) * s[2]);
      if (polynomial.size() > 1) g[0] += S(bend(s[0]) * s[1] * s[1]);
    }
  }
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const double* lambda, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    S force(polynomial[0]);
    if (polynomial.size() > 1) force = slope(coordinate.value(A, B));
    // Structures are taken from entries that are not zero (event::RowIslands).
    if (force == 0.0) force += std::numeric_limits<double>::min();
    force *= lambda[0];
    coordinate.pull(A, B, force, on_first, on_second);
  }
  void rate_by_time(double* g_t) const { g_t[0] = 0.0; }

 private:
  template <class S>
  S slope(const S& s) const {
    S sum(0.0);
    for (std::size_t k = polynomial.size(); k > 0; --k)
      sum = S(sum * s + polynomial[k - 1] * static_cast<double>(k));
    return sum;
  }
  template <class S>
  S bend(const S& s) const {
    S sum(0.0);
    for (std::size_t k = polynomial.size(); k > 1; --k)
      sum = S(sum * s + polynomial[k - 1] * static_cast<double>(k * (k - 1)));
    return sum;
  }
};

/// All kinds of rows, in the order in which they are visited.
using AllRows = std::tuple<std::vector<Coincidence>, std::vector<RightAngle>, std::vector<Angle>,
                           std::vector<Plane>, std::vector<Distance>, std::vector<Relation>>;

}  // namespace tether::scene::joints
