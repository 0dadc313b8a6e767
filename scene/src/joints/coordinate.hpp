// Tether: the coordinate along which a joint leaves its bodies free, or that a motion prescribes.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <tether/linalg/pi.hpp>
#include <tether/scene/engine.hpp>

#include "effects/cable.hpp"
#include "lists.hpp"
#include "mechanics/force.hpp"

namespace tether::scene::joints {

enum class MotionOf { nothing, angle, length };

using namespace mechanics;

/// The second body as the joint's points and axes are on it; `at_start`: at t = 0.
Frame<double> second_at_closing(const Joint& joint, const Frame<double>& at_start);

/// Hinge: the angle of the first body against the second about the axis, rad, in (-pi, pi]; slider:
/// the way of the first body along the axis, m; distance: the distance of both points, m; ball: a
/// component in world axes of the turn of the first body against the second since t = 0, rad.
class Coordinate {
 public:
  /// `bodies`: at t = 0. `component`: x, y, z as 0, 1, 2 of the turn of a ball; else none.
  Coordinate(const Joint& joint, const Bodies& bodies, int component = -1);

  MotionOf what() const { return what_; }
  bool is_component() const { return component_ >= 0; }
  int first() const { return first_; }  ///< of Bodies
  int second() const { return second_; }
  /// The joint's point, carried by the first body: world axes, m.
  Vector3d place(const Bodies& bodies) const { return point<0>(A(bodies), at_first_).x; }

  double value(const Bodies& bodies) const { return value(A(bodies), B(bodies)); }
  double rate(const Bodies& bodies) const { return rate(A(bodies), B(bodies)); }
  /// Its second derivative without accelerations of the bodies.
  double rest(const Bodies& bodies) const;
  /// The unit of force along it, on the first body: what() == angle, the moment u; length, the
  /// force u. World axes.
  Vector3d direction(const Bodies& bodies) const { return direction(A(bodies), B(bodies)); }
  /// Its gradient: loads on both bodies that a unit of force along it makes.
  void gradient(const Bodies& bodies, Wrench<double>& on_first, Wrench<double>& on_second) const {
    on_first = on_second = no_wrench<double>();
    pull(A(bodies), B(bodies), 1.0, on_first, on_second);
  }

  /// The same by the frames of both bodies, for any scalar.
  template <class S>
  S value(const Frame<S>& A, const Frame<S>& B) const {
    using std::atan2;
    using std::sqrt;
    if (is_component()) return turn(A, B);
    if (what_ == MotionOf::angle) {
      const Vector3<S> u = times(A.R, of_first_);
      const S sine = dot(u, times(B.R, ahead_)), cosine = dot(u, times(B.R, zero_));
      return S(atan2(sine, cosine));
    }
    const Vector3<S> d = span(A, B);
    return axis_ ? S(dot(d, times(B.R, *axis_))) : S(sqrt(dot(d, d)));
  }
  template <class S>
  S rate(const Frame<S>& A, const Frame<S>& B) const {
    Wrench<S> on_first = no_wrench<S>(), on_second = no_wrench<S>();
    pull(A, B, S(1.0), on_first, on_second);
    S sum = dot(on_first.force, A.v);
    sum += dot(on_first.torque, A.W);
    sum += dot(on_second.force, B.v);
    sum += dot(on_second.torque, B.W);
    return sum;
  }
  /// Its value and derivatives up to `order` with the accelerations of the frames: of hinges and
  /// sliders.
  // s = atan2(y, x), r s' = x y' - y x', r s'' = x y'' - y x'' - r' s', r = x^2 + y^2
  template <int order, class S>
  void derivatives(const Frame<S>& A, const Frame<S>& B, S* s) const {
    s[0] = value(A, B);
    if constexpr (order == 0) return;
    if (what_ == MotionOf::length) {
      const Jet<S> d = between<order>(A, at_first_, B, at_second_),
                   u = mechanics::direction<order>(B, *axis_);
      if constexpr (order >= 1) s[1] = product<1>(u, d);
      if constexpr (order >= 2) s[2] = product<2>(u, d);
      return;
    }
    const Jet<S> u = mechanics::direction<order>(A, of_first_),
                 along = mechanics::direction<order>(B, zero_),
                 ahead = mechanics::direction<order>(B, ahead_);
    const S x = product<0>(u, along), y = product<0>(u, ahead);
    const S r = S(x * x + y * y);
    if constexpr (order >= 1) {
      const S x1 = product<1>(u, along), y1 = product<1>(u, ahead);
      const S turned = S(x * y1 - y * x1);
      s[1] = S(turned / r);
      if constexpr (order >= 2) {
        const S x2 = product<2>(u, along), y2 = product<2>(u, ahead);
        const S r1 = S(x * x1 + y * y1);
        s[2] = S((x * y2 - y * x2 - 2.0 * r1 * s[1]) / r);
      }
    }
  }
  template <class S>
  Vector3<S> direction(const Frame<S>& A, const Frame<S>& B) const {
    using std::sqrt;
    if (is_component()) {
      Vector3<S> u(S(0.0), S(0.0), S(0.0));
      u[component_] = S(1.0);
      return u;
    }
    if (axis_) return times(B.R, *axis_);
    Vector3<S> d = span(A, B);
    const S square = dot(d, d);
    if (!(square > 0.0)) return d;
    const S length = sqrt(square);
    for (int i = 0; i < 3; ++i) d[i] /= length;
    return d;
  }
  /// Adds a force along it.
  template <class S>
  void pull(const Frame<S>& A, const Frame<S>& B, const S& force, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    Vector3<S> u = direction(A, B);
    for (int i = 0; i < 3; ++i) u[i] *= force;
    if (what_ == MotionOf::angle) {
      for (int i = 0; i < 3; ++i) {
        on_first.torque[i] += u[i];
        on_second.torque[i] -= u[i];
      }
      return;
    }
    // A slider's acts on both bodies at the point of the first.
    const Vector3<S> p = point<0>(A, at_first_).x;
    add_opposite(A, p, B, axis_ ? p : Vector3<S>(point<0>(B, at_second_).x), u, on_first,
                 on_second);
  }

 private:
  static constexpr double kNear = 0.1;  // 1 - cosine: the series has two digits a term

  const Frame<double>& A(const Bodies& bodies) const { return bodies.frames[at(first_)]; }
  const Frame<double>& B(const Bodies& bodies) const { return bodies.frames[at(second_)]; }
  template <class S>
  Vector3<S> span(const Frame<S>& A, const Frame<S>& B) const {
    return between<0>(A, at_first_, B, at_second_).x;
  }
  // The turn Q = A start B' has the vector (angle / sine) (axis of Q - Q') / 2.
  template <class S>
  S turn(const Frame<S>& A, const Frame<S>& B) const {
    S trace(0.0), part(0.0);
    for (int k = 0; k < 3; ++k) {
      const Vector3<S> a = times(A.R, Vector3d(start_.col(k))),
                       b = times(B.R, Vector3d(Vector3d::Unit(k)));
      trace += dot(a, b);
      part += cross(b, a)[component_];
    }
    const S cosine = S(0.5 * (trace - 1.0));
    return S(0.5 * part * angle_over_sine(cosine));
  }
  // sum of n! / (2n + 1)!! (1 - cosine)^n near 1
  template <class S>
  static S angle_over_sine(const S& cosine) {
    using std::acos;
    using std::sqrt;
    const S y = S(1.0 - cosine);
    if (y > kNear) return S(acos(cosine) / sqrt(S(1.0 - cosine * cosine)));
    S term(1.0), sum(1.0);
    for (int n = 1; n < 16; ++n) {
      term = S(term * y * (n / (2.0 * n + 1.0)));
      sum += term;
    }
    return sum;
  }

  MotionOf what_;
  int component_;
  int first_, second_;
  Vector3d at_first_, at_second_;     // in the axes of each body
  Vector3d of_first_, zero_, ahead_;  // angle: it turns of_first from zero to ahead
  std::optional<Vector3d> axis_;      // of the second body; none: along the way between the points
  Matrix3d start_;                    // component: of the second body in axes of the first
};

/// The coordinates along which laws and springs of a joint act, three of a ball. Throws
/// std::invalid_argument where there are none.
std::vector<Coordinate> coordinates_of(const Joint& joint, std::size_t number,
                                       const Bodies& bodies);

/// Limits, motors, friction and springs of all joints of a scene, and what rubs of its cables: as
/// the contact library's steps take them, and one by one.
class JointLaws {
 public:
  /// `bodies`: at t = 0. Throws std::invalid_argument on laws of joints that have no free
  /// coordinate, and on a start beyond a limit.
  JointLaws(const Scene& scene, const Bodies& bodies);

  bool any() const { return !joints_.empty() || !slips_.empty(); }
  const std::vector<effects::CapstanSlip>& slips() const { return slips_; }
  /// In the order of add(), after which these can be asked for.
  int count() const { return static_cast<int>(placed_.size()); }
  /// The slip of a cable; null: it is of a joint.
  const effects::CapstanSlip* slip(int law) const {
    const int k = placed_[at(law)].item - static_cast<int>(joints_.size());
    return k < 0 ? nullptr : &slips_[at(k)];
  }
  // For laws of joints.
  double sign(int law) const { return placed_[at(law)].sign; }  ///< -1: sees it backwards
  int joint(int law) const { return item(law).joint; }          ///< of the scene
  const Coordinate& coordinate(int law) const { return item(law).coordinate; }
  double value(int law, const Bodies& bodies) const { return value(item(law), bodies); }
  /// Loads that a unit of force along a law makes: f(body, wrench) for those that move.
  template <class F>
  void each_load(int law, const Bodies& bodies, const F& f) const {
    if (const effects::CapstanSlip* of = slip(law)) return of->each_load(bodies, f);
    const Coordinate& along = coordinate(law);
    Wrench<double> on[2];
    along.gradient(bodies, on[0], on[1]);
    const int body[2] = {along.first(), along.second()};
    for (int side = 0; side < 2; ++side) {
      on[side].force *= sign(law);
      on[side].torque *= sign(law);
      if (bodies.moves(body[side])) f(body[side], on[side]);
    }
  }
  void add(const Bodies& bodies, contact::JointLaws& out);
  /// The grips of all slips(), in their order.
  void grip(const Bodies& bodies, std::vector<effects::Grip>& out) const {
    out.clear();
    for (const effects::CapstanSlip& each : slips_) out.push_back(each.grip(bodies));
  }
  /// Whether the bound of a law depends on the forces of others (effects::share_tensions).
  bool shares_tension(int law) const {
    const effects::CapstanSlip* of = slip(law);
    const auto same = [&](const effects::CapstanSlip& each) {
      return &each != of && each.cable() == of->cable();
    };
    return of != nullptr && any_of(slips_, same);
  }
  /// Puts the bounds that the impulses leave into the laws of the last add(); true: they changed.
  bool change_bounds(const std::vector<double>& impulses, double dt,
                     contact::JointLaws& laws) const;
  /// Adds a force along a law to that of its joint, or to the means of its cable's tensions.
  void add_force(int law, const Bodies& bodies, double force, Forces& out) const;
  /// The same of the impulses (of the last add()) over dt; springs are Forces and tell theirs.
  void add_forces(const Bodies& bodies, const std::vector<double>& impulses, double dt,
                  Forces& out) const {
    for (std::size_t i = 0; dt > 0 && i < impulses.size() && i < placed_.size(); ++i)
      if (!placed_[i].sprung) add_force(static_cast<int>(i), bodies, impulses[i] / dt, out);
  }

 private:
  struct Item {
    int joint;
    Joint law;
    Coordinate coordinate;
  };
  struct Placed {
    int item;
    double sign;
    bool sprung;
  };
  // One law after the other: a term goes to the law added last.
  void place(int item, double sign, const Bodies& bodies, contact::JointLaws& out) {
    placed_.push_back({item, sign, out[out.count() - 1].is_sprung()});
    each_load(count() - 1, bodies, [&](int body, const Wrench<double>& on) {
      contact::Vector6d G;
      G << on.force, on.torque;
      out.on(body, G);
    });
  }
  // The turn of a hinge whose angle is nearest to the middle between its limits.
  double value(const Item& item, const Bodies& bodies) const {
    const double value = item.coordinate.value(bodies);
    if (!item.law.limits || item.coordinate.what() != MotionOf::angle) return value;
    const double middle = 0.5 * (item.law.limits->lower + item.law.limits->upper);
    const double turn = 2 * linalg::kPi;
    return value + turn * std::round((middle - value) / turn);
  }
  void measure_ball(std::size_t component, const Bodies& bodies,
                    mechanics::JointLawList& out) const;
  const Item& item(int law) const { return joints_[at(placed_[at(law)].item)]; }

  std::vector<Item> joints_;                 // a ball is three
  std::vector<effects::CapstanSlip> slips_;  // behind them
  std::vector<effects::Grip> grips_;         // of these, at the last add()
  std::vector<Placed> placed_;               // by law
};

}  // namespace tether::scene::joints
