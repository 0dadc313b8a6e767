// Tether: what a pair of features is at the state of its two bodies. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "bounds.hpp"
#include "geometry/outline.hpp"
#include "mechanics/bodies.hpp"
#include "mechanics/frames.hpp"

namespace tether::scene::event {

using namespace mechanics;

/// The gap of features that do not face each other.
constexpr double kNowhere = -kInfinity;

/// Sine by which features that lie flush in a face may be turned beyond it by rounding.
constexpr double kFlush = 0.1;

struct Touch {
  double gap = 0, rate = 0, second = 0;
  Vector3d normal = Vector3d::UnitZ(), point = Vector3d::Zero();
  Vector3d normal_rate = Vector3d::Zero();     ///< n'
  Vector3d point_velocity = Vector3d::Zero();  ///< of the contact point as it moves over the bodies
};

/// The half-space n.(x - b) <= 0 of the second body, or a face of it: where all border.x <= limit.
struct PlaneFeature {
  Vector3d at = Vector3d::Zero(), normal = Vector3d::UnitZ();
  std::vector<std::pair<Vector3d, double>> border;  ///< in the axes of the body

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre,
              double radius) const {
    const Jet<double> c = mechanics::point<2>(A, centre), b = mechanics::point<2>(B, at);
    const Jet<double> n = direction<2>(B, normal);
    const Vector3d d = c.x - b.x, d1 = c.x1 - b.x1, d2 = c.x2 - b.x2;
    Touch t;
    t.gap = n.x.dot(d) - radius;
    t.rate = n.x1.dot(d) + n.x.dot(d1);
    t.second = n.x2.dot(d) + 2 * n.x1.dot(d1) + n.x.dot(d2);
    t.normal = n.x;
    t.normal_rate = n.x1;
    t.point = c.x - radius * n.x;
    t.point_velocity = c.x1 - radius * n.x1;
    return t;
  }
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre) const {
    double least = kInfinity;
    if (border.empty()) return least;
    const Vector3d local = point_in(B, mechanics::point<0>(A, centre).x);
    for (const auto& [outward, limit] : border) least = std::min(least, limit - outward.dot(local));
    return least;
  }
};

/// Gap, rates and normal of two round features whose middles are d = (d, d', d'') apart; `n1` gets
/// the rate of the normal. The point of contact is left to the caller.
inline Touch apart(const Vector3d& d, const Vector3d& d1, const Vector3d& d2, double radius_first,
                   double radius, Vector3d& n1) {
  const double D = d.norm();
  Touch t;
  t.normal = d / D;
  t.gap = D - radius_first - radius;
  t.rate = t.normal.dot(d1);
  t.second = t.normal.dot(d2) + (d1.squaredNorm() - t.rate * t.rate) / D;
  t.normal_rate = n1 = (d1 - t.normal * t.rate) / D;
  return t;
}

//   c = e x f, D = |c|, n = +- c / D, d = a - b        gap = n.d - r
//   n' = (c' - D' n) / D,  D' = n.c'                   n'' = (c'' - D'' n - 2 D' n') / D
//
// a + s e the line of the first body, b + t f that of the second. Of sharp edges n points out of
// the second body, and counts where it leads out of both of each edge's faces (their arcs on the
// Gauss sphere cross); of round bars it points from the second to the first. Lines that are
// parallel have no such contact: their ends do.
//
// For an edge that lies flush with a face of the other body, n is at the end of an arc, on either
// side of it by rounding. Beyond the end the gap still bounds one of the true ones from above, as
// long as its line goes on over the face: so arcs are longer by kFlush. (A face that turns about
// the other edge is left by its own border: its corners and other edges touch by then.)

using scene::Segment;

struct CrossingFeature {
  Segment first, second;

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d&) const;

 private:
  /// Out of the second body, or from it to the first one.
  static double sign(const Frame<double>& B, const Segment& second, const Vector3d& c,
                     const Vector3d& d) {
    if (!second.is_sharp()) return d.dot(c) < 0 ? -1 : 1;
    return c.dot(B.R * (second.inward[0] + second.inward[1])) > 0 ? -1 : 1;
  }
  static constexpr double kParallel = 1e-9;  // squared sine
};

inline Touch CrossingFeature::touch(const Frame<double>& A, const Frame<double>& B, const Vector3d&,
                                    double) const {
  using mechanics::direction;
  const Jet<double> a = mechanics::point<2>(A, first.at), b = mechanics::point<2>(B, second.at);
  const Jet<double> e = direction<2>(A, first.along), f = direction<2>(B, second.along);
  const Vector3d d = a.x - b.x, d1 = a.x1 - b.x1, d2 = a.x2 - b.x2;
  Vector3d c = e.x.cross(f.x), c1 = e.x1.cross(f.x) + e.x.cross(f.x1),
           c2 = e.x2.cross(f.x) + 2 * e.x1.cross(f.x1) + e.x.cross(f.x2);
  Touch t;
  const double square = c.squaredNorm();
  if (square < kParallel) {
    t.gap = kNowhere;
    t.point = a.x;
    return t;
  }
  const double s = sign(B, second, c, d), D = std::sqrt(square), D1 = s * c.dot(c1) / D;
  const Vector3d n = s * c / D, n1 = (s * c1 - s * D1 * n) / D;
  const double along1 = s * D1;  // D' = n.c' of the signed c
  const double along2 = n1.dot(s * c1) + n.dot(s * c2);
  const Vector3d n2 = (s * c2 - along2 * n - 2 * along1 * n1) / D;
  t.normal = n;
  t.normal_rate = n1;
  t.gap = n.dot(d) - first.radius - second.radius;
  t.rate = n1.dot(d) + n.dot(d1);
  t.second = n2.dot(d) + 2 * n1.dot(d1) + n.dot(d2);
  // The point of the first line that is nearest to the second one, and its velocity.
  const double k = -d.cross(f.x).dot(c) / square;
  const double k1 =
      (-(d1.cross(f.x) + d.cross(f.x1)).dot(c) - d.cross(f.x).dot(c1) - 2 * k * c.dot(c1)) / square;
  t.point = a.x + k * e.x - first.radius * n;
  t.point_velocity = a.x1 + k1 * e.x + k * e.x1 - first.radius * n1;
  return t;
}

inline double CrossingFeature::margin(const Frame<double>& A, const Frame<double>& B,
                                      const Vector3d&) const {
  const Vector3d d = mechanics::point<0>(A, first.at).x - mechanics::point<0>(B, second.at).x;
  const Vector3d e = A.R * first.along, f = B.R * second.along, c = e.cross(f);
  const double square = c.squaredNorm();
  if (square < kParallel) return -(first.length + second.length);
  const double s = -d.cross(f).dot(c) / square, t = -d.cross(e).dot(c) / square;
  double least = std::min(std::min(s, first.length - s), std::min(t, second.length - t));
  const Vector3d n = sign(B, second, c, d) * c / std::sqrt(square);
  for (const Vector3d& inward : second.inward)
    if (second.is_sharp()) least = std::min(least, second.length * (kFlush - n.dot(B.R * inward)));
  for (const Vector3d& inward : first.inward)
    if (first.is_sharp()) least = std::min(least, first.length * (kFlush + n.dot(A.R * inward)));
  return least;
}

}  // namespace tether::scene::event
