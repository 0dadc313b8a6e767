// Tether: pairs of features that can touch, with their gaps and rates. SPDX-License-Identifier:
// BSD-3-Clause
//
// The first feature is a point of the first body with a radius (the centre of a sphere; a vertex
// has radius 0), the second a plane, a point or a line of the second body. Each kind has
//   touch(A, B)  gap, gap', gap'' (without accelerations where the frames have none), the normal n
//                from second to first, the contact point p and its velocity
//   margin(A, B) how far the contact is inside the borders of both, m; < 0: others are nearer there
// A plane may be a face with a border.
//
//   plane   gap = n.(c - b) - r                         n' = W_B x n
//   point   gap = |d| - r - r_B,  d = c - b             gap'' = n.d'' + (|d'|^2 - gap'^2) / |d|
//   line    the same of d without its part along the line, in axes that turn with B
//   crossing: two lines, see there; the first feature is not a point then
//   round: ellipsoids and ends of cylinders, see there; likewise
#pragma once

#include <algorithm>
#include <cmath>
#include <variant>

#include "bounds.hpp"
#include "geometry/shape_type.hpp"
#include "mechanics/force.hpp"
#include "mechanics/frames.hpp"

namespace tether::scene::event {

// With d the way from the second feature's centre to the first one's, s and t their supports:
//
//   plane        gap = n.d - s(n)                             n that of the plane
//   round        gap = max over |n| = 1 of f(n) = n.d - s(n) - t(n)
//   line         the same with n at right angles to the line, from its nearest point
//
// (supports are even). At the maximum g = df/dn is along n: the way between the nearest points. Its
// length c is the gap, and with H the second derivatives of the supports, T at right angles to n
// (and to the line), w the part of n' that the line's turning prescribes,
//
//   n' = w + T z,   (T' H T + c) z = T' (g_t - H w)
//   gap'  = f_t,    gap'' = f_tt + 2 n'.g_t - n'.H n' - c |n'|^2

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

inline Jet<double> way(const Jet<double>& from, const Jet<double>& to) {
  return {to.x - from.x, to.x1 - from.x1, to.x2 - from.x2};
}

/// d without its part along the unit vector e.
inline Jet<double> across(const Jet<double>& d, const Jet<double>& e) {
  const double k = d.x.dot(e.x), k1 = d.x1.dot(e.x) + d.x.dot(e.x1),
               k2 = d.x2.dot(e.x) + 2 * d.x1.dot(e.x1) + d.x.dot(e.x2);
  return {d.x - k * e.x, d.x1 - k1 * e.x - k * e.x1, d.x2 - k2 * e.x - 2 * k1 * e.x1 - k * e.x2};
}

/// Gap, rates and normal of two round features whose middles are d apart. The point of contact is
/// left to the caller.
inline Touch apart(const Jet<double>& d, double radius_first, double radius) {
  const double D = d.x.norm();
  Touch t;
  t.normal = d.x / D;
  t.gap = D - radius_first - radius;
  t.rate = t.normal.dot(d.x1);
  t.second = t.normal.dot(d.x2) + (d.x1.squaredNorm() - t.rate * t.rate) / D;
  t.normal_rate = (d.x1 - t.normal * t.rate) / D;
  return t;
}

using scene::Face;
using scene::Knob;
using scene::Round;
using scene::Segment;

/// A point of the first body with a radius, on a plane or face of the second one.
struct PointOnPlane {
  Knob first;
  Face plane;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const {
    const Jet<double> c = mechanics::point<2>(A, first.at), n = direction<2>(B, plane.normal);
    const Jet<double> d = way(mechanics::point<2>(B, plane.at), c);
    Touch t;
    t.gap = n.x.dot(d.x) - first.radius;
    t.rate = n.x1.dot(d.x) + n.x.dot(d.x1);
    t.second = n.x2.dot(d.x) + 2 * n.x1.dot(d.x1) + n.x.dot(d.x2);
    t.normal = n.x;
    t.normal_rate = n.x1;
    t.point = c.x - first.radius * n.x;
    t.point_velocity = c.x1 - first.radius * n.x1;
    return t;
  }
  /// A vertex touches a face whose normal no edge of it goes against. (That of a box which stands
  /// flush on another one is on the border of the other's side faces, too: its edges go into them.)
  double margin(const Frame<double>& A, const Frame<double>& B) const {
    if (plane.border.empty()) return kInfinity;
    double least = plane.margin(point_in(B, mechanics::point<0>(A, first.at).x));
    const Vector3d normal = B.R * plane.normal;
    for (const Vector3d& along : first.edges)
      least = std::min(least, kFlush * along.norm() + normal.dot(A.R * along));
    return least;
  }
};

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

struct CrossingFeature {
  Segment first, second;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const {
    using mechanics::direction;
    const Jet<double> a = mechanics::point<2>(A, first.at);
    const Jet<double> e = direction<2>(A, first.along), f = direction<2>(B, second.along);
    const auto [d, d1, d2] = way(mechanics::point<2>(B, second.at), a);
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
        (-(d1.cross(f.x) + d.cross(f.x1)).dot(c) - d.cross(f.x).dot(c1) - 2 * k * c.dot(c1)) /
        square;
    t.point = a.x + k * e.x - first.radius * n;
    t.point_velocity = a.x1 + k1 * e.x + k * e.x1 - first.radius * n1;
    return t;
  }
  double margin(const Frame<double>& A, const Frame<double>& B) const {
    const Vector3d d = mechanics::point<0>(A, first.at).x - mechanics::point<0>(B, second.at).x;
    const Vector3d e = A.R * first.along, f = B.R * second.along, c = e.cross(f);
    const double square = c.squaredNorm();
    if (square < kParallel) return -(first.length + second.length);
    const double s = -d.cross(f).dot(c) / square, t = -d.cross(e).dot(c) / square;
    double least = std::min(std::min(s, first.length - s), std::min(t, second.length - t));
    const Vector3d n = sign(B, second, c, d) * c / std::sqrt(square);
    for (const Vector3d& inward : second.inward)
      if (second.is_sharp())
        least = std::min(least, second.length * (kFlush - n.dot(B.R * inward)));
    for (const Vector3d& inward : first.inward)
      if (first.is_sharp()) least = std::min(least, first.length * (kFlush + n.dot(A.R * inward)));
    return least;
  }

 private:
  /// Out of the second body, or from it to the first one.
  static double sign(const Frame<double>& B, const Segment& second, const Vector3d& c,
                     const Vector3d& d) {
    if (!second.is_sharp()) return d.dot(c) < 0 ? -1 : 1;
    return c.dot(B.R * (second.inward[0] + second.inward[1])) > 0 ? -1 : 1;
  }
  static constexpr double kParallel = 1e-9;  // squared sine
};

// With L the shape of a Round in world axes
//
//   s(n) = |L' n| + r |n|      the farthest it reaches along n from its centre
//   ds/dn                      the point that is that far
//
// and L' = W x L, L'' = alpha x L + W x L'.

/// Support function of a round body whose frame is known, for unit directions n; `_t`: its
/// derivative by time with n fixed.
class Support {
 public:
  Support(const Frame<double>& f, const Round& of) : L_(f.R * of.shape), radius_(of.radius) {
    // Sine below which a disc is flush with what it touches.
    flat_ = 1e-9 * L_.norm();
    for (int k = 0; k < 3; ++k) {
      L1_.col(k) = f.W.cross(L_.col(k));
      L2_.col(k) = f.alpha.cross(L_.col(k)) + f.W.cross(L1_.col(k));
    }
  }

  struct At {
    double s = 0, s_t = 0, s_tt = 0;
    Vector3d point = Vector3d::Zero(), point_t = Vector3d::Zero();  ///< from the centre
    Matrix3d bend = Matrix3d::Zero();                               ///< d point / dn
  };
  At at(const Vector3d& n) const {
    At out;
    const Vector3d u = L_.transpose() * n;
    const double e = u.norm();
    if (e > flat_) {
      const Vector3d u1 = L1_.transpose() * n, u2 = L2_.transpose() * n;
      const Vector3d p = L_ * u / e;
      out.s = e;
      out.s_t = u.dot(u1) / e;
      out.s_tt = (u1.squaredNorm() + u.dot(u2) - out.s_t * out.s_t) / e;
      out.point = p;
      out.point_t = (L1_ * u + L_ * u1 - p * out.s_t) / e;
      out.bend = (L_ * L_.transpose() - p * p.transpose()) / e;
    }
    out.s += radius_;
    out.point += radius_ * n;
    out.bend += radius_ * (Matrix3d::Identity() - n * n.transpose());
    return out;
  }
  /// How far a disc reaches along n, which is nothing along its axis.
  double reach(const Vector3d& n) const { return (L_.transpose() * n).norm(); }

 private:
  Matrix3d L_, L1_, L2_;
  double radius_, flat_ = 0;
};

/// A round feature of the first body on a plane or face of the second one. A face of a cylinder is
/// bordered by a circle.
struct RoundOnPlane {
  Round first;
  Face plane;
  double disc = 0;  ///< radius of its border, about plane.at; 0: none

  Touch touch(const Frame<double>& A, const Frame<double>& B) const;
  double margin(const Frame<double>& A, const Frame<double>& B) const;
  /// A disc is flush with the plane: it touches in more points than one.
  bool is_flush(const Frame<double>& A, const Frame<double>& B) const {
    return first.is_disc() &&
           Support(A, first).reach(times(B.R, plane.normal)) < 1e-6 * first.size();
  }
};

/// Two round features.
struct RoundOnRound {
  Round first, second;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const;
  double margin(const Frame<double>& A, const Frame<double>& B) const;
};

/// A round feature on a line of the second body, which has a radius.
struct RoundOnLine {
  Round first;
  Segment line;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const;
  double margin(const Frame<double>& A, const Frame<double>& B) const;
};

/// A sphere or point of the first body on the circle of a cylinder's end. (Where it comes over from
/// the face the supports have a kink, the distance has none.)
struct PointOnCircle {
  Knob first;
  Vector3d at = Vector3d::Zero(), axis = Vector3d::UnitZ();  ///< out of the body
  double circle = 0;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const;
  double margin(const Frame<double>& A, const Frame<double>& B) const;
};

/// Points of both bodies, with radii.
struct PointOnPoint {
  Knob first;
  Vector3d at = Vector3d::Zero();
  double radius = 0;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const {
    const Jet<double> b = mechanics::point<2>(B, at);
    Touch t = apart(way(b, mechanics::point<2>(A, first.at)), first.radius, radius);
    // Between the surfaces, by their radii: at a gap of 0 it is the point of contact.
    t.point = b.x + radius * t.normal;
    t.point_velocity = b.x1 + radius * t.normal_rate;
    return t;
  }
  double margin(const Frame<double>&, const Frame<double>&) const { return kInfinity; }
};

/// A point of the first body on a line of the second one, both with radii.
struct PointOnLine {
  Knob first;
  Segment line;

  Touch touch(const Frame<double>& A, const Frame<double>& B) const {
    const Jet<double> c = mechanics::point<2>(A, first.at), e = direction<2>(B, line.along);
    Touch t = apart(across(way(mechanics::point<2>(B, line.at), c), e), first.radius, line.radius);
    t.point = c.x - first.radius * t.normal;
    t.point_velocity = c.x1 - first.radius * t.normal_rate;
    return t;
  }
  double margin(const Frame<double>& A, const Frame<double>& B) const {
    const Vector3d s = mechanics::point<0>(A, first.at).x - mechanics::point<0>(B, line.at).x;
    const double k = s.dot(times(B.R, line.along));
    return std::min(k, line.length - k);
  }
};

/// Friction that depends on the direction: coefficients along and across an axis of a body, over
/// the larger one.
struct EllipticFriction {
  int body = 0;   ///< that has the axis
  Vector3d axis;  ///< unit, in its axes
  double along = 1, across = 1;
};

/// One potential contact of a scene.
struct FeaturePair {
  int first = 0, second = 0;  ///< bodies, as in Bodies
  std::variant<PointOnPlane, PointOnPoint, PointOnLine, CrossingFeature, RoundOnPlane, RoundOnRound,
               RoundOnLine, PointOnCircle>
      features;
  double friction = 0, restitution = 0;
  std::optional<EllipticFriction> elliptic;  ///< `friction` is the larger coefficient
  double rolling = 0, torsional = 0;         ///< m
  double reach = kInfinity;  ///< of both shapes from the centres of their bodies, together

  Touch touch(const Bodies& bodies) const {
    const Frame<double>&A = bodies.frames[at(first)], &B = bodies.frames[at(second)];
    return std::visit([&](const auto& pair) { return pair.touch(A, B); }, features);
  }
  bool is_apart(const Bodies& bodies, double by) const {
    const double most = reach + by;
    return (bodies.frames[at(first)].x - bodies.frames[at(second)].x).squaredNorm() > most * most;
  }
  double passes(const Bodies& bodies) const {
    const Frame<double>&A = bodies.frames[at(first)], &B = bodies.frames[at(second)];
    return (A.v - B.v).norm() / reach + (std::isinf(reach) ? 0 : A.W.norm() + B.W.norm());
  }
  /// It touches in more points than one contact can stand for.
  bool is_flush(const Bodies& bodies) const {
    const auto* round = std::get_if<RoundOnPlane>(&features);
    return round != nullptr && round->is_flush(bodies.frames[at(first)], bodies.frames[at(second)]);
  }
  double margin(const Bodies& bodies) const {
    const Frame<double>&A = bodies.frames[at(first)], &B = bodies.frames[at(second)];
    return std::visit([&](const auto& pair) { return pair.margin(A, B); }, features);
  }
};

}  // namespace tether::scene::event
