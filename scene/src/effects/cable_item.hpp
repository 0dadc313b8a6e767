// Tether: one cable in the axes of its bodies. SPDX-License-Identifier: BSD-3-Clause
//
// With L the sum of the distances from point to point, and s = L - rest - winch t:
//
//   tension T = max(0, k s + c ds/dt) where s > 0, else 0; where the cable rubs at a ring this is
//   the mean of the tensions before and behind it
#pragma once

#include "mechanics/effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

using namespace mechanics;

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

}  // namespace tether::scene::effects
