// Tether: springs and cables: tensions, and the slip of cables over rings at which they rub.
// SPDX-License-Identifier: BSD-3-Clause
//
// With L the sum of the distances from point to point, and s = L - rest - winch t:
//
//   tension T = max(0, k s + c ds/dt) where s > 0, else 0; where the cable rubs at a ring this is
//   the mean of the tensions before and behind it
//
// With the lengths L_1 before and L_2 behind a ring, the tensions T_1 and T_2 there, the wrap angle
// beta and a pulley of radius r that turns with w about its axis u:
//
//   slip y' = L_2' - L_1' + winch - 2 r u.w       the cable feeds from its first end
//   x = (T_1 - T_2) / 2,  |x| <= (T_1 + T_2) / 2 tanh(mu beta / 2),  x opposes y', and is the bound
//   where it slips
//
// which is e^(-mu beta) <= T_2 / T_1 <= e^(mu beta). T is the mean of the tensions at the ends, so
// that T L' + sum of x y' over the rings is the power of all tensions.
#pragma once

#include "mechanics/effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

inline bool is_cable(const Spring& spring) { return spring.cable.has_value(); }

/// The largest inverse mass of a point of a body in any direction, 1/kg.
inline double softness(const Bodies& bodies, int body, const Vector3d& where) {
  if (!bodies.moves(body)) return 0.0;
  const Inertia& inertia = bodies.inertia[at(body)];
  return 1 / inertia.mass + where.squaredNorm() * inertia.inverse.trace();
}

/// Explicit springs of a semi-implicit step need dt^2 k / m < 4 and dt c / m < 2; together
/// dt^2 k + 2 dt c < 4 m. `inverse`: 1 / m along the spring.
inline void check_tension_step(const Scene& scene, const Spring& spring, double inverse,
                               double dt) {
  if ((dt * spring.stiffness + 2 * spring.damping) * dt * inverse < 4) return;
  const double c = 2 * spring.damping * inverse, k = spring.stiffness * inverse;
  const double most = k > 0 ? (std::sqrt(c * c + 16 * k) - c) / (2 * k) : 4 / c;
  throw std::invalid_argument(fmt::format(
      "{}:{}: {} \"{}\": a step of {:g} s is too long for it to be stable; stepping.step "
      "must be below about {:g} s (or, without contacts, use the smooth engine)",
      scene.file, spring.place.line, spring.cable ? "cable" : "spring", spring.name, dt, most));
}

inline void report_tension(std::size_t index, const SpringForce& force, Forces& forces) {
  forces.springs.resize(std::max(forces.springs.size(), index + 1));
  forces.springs[index] = force;
  forces.springs[index].tension_second = force.tension;
}

struct CablePoint {
  int body;
  Vector3d at;  // in its axes
};

/// A piece of a cable between two of its points.
template <class S>
struct Piece {
  Vector3<S> from, to, along;
  S length, rate;

  Piece(const Frame<S>& A, const Vector3d& in_a, const Frame<S>& B, const Vector3d& in_b)
      : length(0.0), rate(0.0) {
    using std::sqrt;
    const Jet<S> a = point<1>(A, in_a), b = point<1>(B, in_b);
    from = a.x;
    to = b.x;
    along = b.x - a.x;
    const S square = dot(along, along);
    // Points that coincide have no direction, and the cable has none to pull in there.
    if (!(square > 0.0)) {
      along = Vector3<S>(S(0.0), S(0.0), S(0.0));
      return;
    }
    length = sqrt(square);
    for (int i = 0; i < 3; ++i) along[i] /= length;
    const Vector3<S> relative = b.x1 - a.x1;
    rate = dot(along, relative);
  }
  /// Adds the loads of the tension T on both bodies.
  void pull(const Frame<S>& A, const Frame<S>& B, double T, Wrench<S>& on_a,
            Wrench<S>& on_b) const {
    Vector3<S> force = along;
    for (int i = 0; i < 3; ++i) force[i] *= T;
    on_a.add(A, from, force);
    on_b.add(B, to, Vector3<S>(-force));
  }
};

struct CableItem {
  std::size_t index;  // of the scene's springs
  std::vector<CablePoint> points;
  double stiffness, damping, rest, winch;

  CableItem(const Spring& spring, std::size_t number, const Bodies& bodies)
      : index(number),
        stiffness(spring.stiffness),
        damping(spring.damping),
        rest(0),
        winch(spring.cable->winch) {
    const auto add_point = [&](int body, const Vector3d& where) {
      const int place = bodies.index(body);
      points.push_back({place, point_in(bodies.frames[at(place)], where)});
    };
    add_point(spring.first, spring.at);
    for (const Ring& ring : spring.cable->rings) add_point(ring.body, ring.at);
    add_point(spring.second, spring.at_second);
    rest = spring.rest ? *spring.rest : measured(bodies).first;
  }

  const Frame<double>& frame(const Bodies& bodies, std::size_t p) const {
    return bodies.frames[at(points[p].body)];
  }
  Piece<double> piece(const Bodies& bodies, std::size_t k) const {
    return {frame(bodies, k), points[k].at, frame(bodies, k + 1), points[k + 1].at};
  }
  /// Length and rate.
  std::pair<double, double> measured(const Bodies& bodies) const {
    std::pair<double, double> sum(0.0, 0.0);
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      const Piece<double> each = piece(bodies, k);
      sum.first += each.length;
      sum.second += each.rate;
    }
    return sum;
  }
  /// The wrench on the body of each point in turn, both pieces together: tension(k) in the k-th.
  template <class Tension, class Do>
  void each_wrench(const Bodies& bodies, const Tension& tension, const Do& act) const {
    Wrench<double> left = no_wrench<double>();
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      Wrench<double> right = no_wrench<double>();
      piece(bodies, k).pull(frame(bodies, k), frame(bodies, k + 1), tension(k), left, right);
      act(points[k].body, left);
      left = right;
    }
    act(points.back().body, left);
  }
  /// Adds the wrench at one point, of both its pieces.
  template <class Tension>
  void add_wrench(const Bodies& bodies, std::size_t p, const Tension& tension,
                  Wrench<double>& out) const {
    Wrench<double> other = no_wrench<double>();
    if (p > 0)
      piece(bodies, p - 1).pull(frame(bodies, p - 1), frame(bodies, p), tension(p - 1), other, out);
    if (p + 1 < points.size())
      piece(bodies, p).pull(frame(bodies, p), frame(bodies, p + 1), tension(p), out, other);
  }
};

/// The tension and its derivatives to length and rate.
struct CableTension {
  double elastic = 0, tension = 0, stretch = 0, by_length = 0, by_rate = 0, elastic_by_length = 0;

  CableTension(const CableItem& of, double time, double length, double rate) {
    stretch = length - of.rest - of.winch * time;
    if (!(stretch > 0)) return;
    elastic = of.stiffness * stretch;
    elastic_by_length = of.stiffness;
    tension = elastic + of.damping * (rate - of.winch);
    if (tension > 0) {
      by_length = of.stiffness;
      by_rate = of.damping;
    } else {
      tension = 0;
    }
  }
  CableTension(const CableItem& of, const Bodies& bodies)
      : CableTension(of, bodies.time, of.measured(bodies)) {}

 private:
  CableTension(const CableItem& of, double time, const std::pair<double, double>& now)
      : CableTension(of, time, now.first, now.second) {}
};

/// The mean tension of a cable, and tanh(mu beta / 2) at one of its rings.
struct Grip {
  int cable;  // of the scene's springs
  double mean, hold;
  double bound() const { return mean * hold; }  ///< of the only ring
};

/// The bounds at the rings of cables that rub at several ones, where the tension after each ring is
///
///   T_j = T_j-1 - 2 x_j where it holds,   T_j-1 e^(-+ mu beta) where it slips
///
/// force(ring): x and 0 where it holds, 0 and the sign of x where it slips. `loaded`: 1; 0: what
/// forces alone make of the bounds, which are affine in them. put(ring, bound).
template <class Force, class Put>
void share_tensions(const std::vector<Grip>& rings, double loaded, const Force& force,
                    const Put& put) {
  const auto passed = [&](std::size_t j, double tension, double rest) {
    const auto [x, slips] = force(j);
    const double part = slips * rings[j].hold;
    return std::pair(tension * (1 - part) / (1 + part), rest * (1 - part) / (1 + part) - 2 * x);
  };
  for (std::size_t first = 0, end = 0; first < rings.size(); first = end) {
    while (end < rings.size() && rings[end].cable == rings[first].cable) ++end;
    if (end - first < 2) continue;
    double share = 1, rest = 0;  // the last tension: share T_0 + rest
    for (std::size_t j = first; j < end; ++j) std::tie(share, rest) = passed(j, share, rest);
    double tension = (2 * loaded * rings[first].mean - rest) / (1 + share);
    for (std::size_t j = first; j < end; ++j) {
      const auto [slipped, held] = passed(j, tension, 0);
      put(j, rings[j].hold * 0.5 * (tension + slipped + held));
      tension = slipped + held;
    }
  }
}

/// The slip of a cable at one of its rings.
class CapstanSlip {
 public:
  /// `bodies`: at t = 0.
  CapstanSlip(const Spring& spring, std::size_t number, const Capstan& law, const Bodies& bodies)
      : item_(spring, number, bodies), law_(law) {
    axis_ = direction_in(item_.frame(bodies, at(law_.ring)), law_.axis);
    for (const CablePoint& each : item_.points)
      if (bodies.moves(each.body)) moving_.push_back(each.body);
    sort_unique(moving_);
  }

  int cable() const { return static_cast<int>(item_.index); }  ///< of the scene's springs
  /// y' is rate() less this.
  double wanted() const { return -item_.winch; }
  // |u - v| / |u + v| is the tangent of half the angle between the pieces.
  Grip grip(const Bodies& bodies) const {
    double wrap = law_.wrap.value_or(0);
    if (!law_.wrap) {
      const Vector3d u = item_.piece(bodies, at(law_.ring) - 1).along,
                     v = item_.piece(bodies, at(law_.ring)).along;
      wrap = 2 * std::atan2((u - v).norm(), (u + v).norm());
    }
    return {cable(), CableTension(item_, bodies).tension, std::tanh(0.5 * law_.friction * wrap)};
  }
  double rate(const Bodies& bodies) const {
    double sum = 0;
    each_load(bodies, [&](int body, const Wrench<double>& unit) {
      const Frame<double>& f = bodies.frames[at(body)];
      sum += unit.force.dot(f.v) + unit.torque.dot(f.W);
    });
    return sum;
  }
  /// The rate of rate() without accelerations of the bodies.
  double rest(const Bodies& bodies) const;
  /// The loads of x = 1: f(body, wrench) once for each body that moves.
  template <class F>
  void each_load(const Bodies& bodies, const F& f) const {
    for (const int body : moving_) {
      Wrench<double> sum = no_wrench<double>();
      for (std::size_t p = 0; p < item_.points.size(); ++p)
        if (item_.points[p].body == body)
          item_.add_wrench(
              bodies, p, [this](std::size_t k) { return sign(k); }, sum);
      if (item_.points[at(law_.ring)].body == body)
        sum.torque -= 2 * law_.radius * (item_.frame(bodies, at(law_.ring)).R * axis_);
      f(body, sum);
    }
  }

 private:
  /// Sign of a piece: 1 before the ring, -1 behind it.
  double sign(std::size_t piece) const { return piece < at(law_.ring) ? 1 : -1; }

  CableItem item_;
  Capstan law_;
  Vector3d axis_;            // of the pulley, in axes of the ring's body
  std::vector<int> moving_;  // bodies, ascending
};

}  // namespace tether::scene::effects
