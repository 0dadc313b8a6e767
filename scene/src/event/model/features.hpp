// Tether: pairs of features that can touch, with their gaps and rates. SPDX-License-Identifier:
// BSD-3-Clause
//
// The first feature is a point of the first body with a radius (the centre of a sphere; a vertex
// has radius 0), the second a plane, a point or a line of the second body. Each kind has
//   touch(A, B)  gap, gap', gap'' (without accelerations where the frames have none), the normal n
//                from second to first, the contact point p and its velocity
// and an `inside(A, B)`: whether the second feature is the one that is nearest there; a plane may
// be a face with a border.
//
//   plane   gap = n.(c - b) - r                         n' = W_B x n
//   point   gap = |d| - r - r_B,  d = c - b             gap'' = n.d'' + (|d'|^2 - gap'^2) / |d|
//   line    the same of d without its part along the line, in axes that turn with B
//   crossing: two lines, see there; the first feature is not a point then
//   round: ellipsoids and ends of cylinders, see there; likewise
#pragma once

#include <variant>

#include "bounds.hpp"
#include "round.hpp"
#include "touch.hpp"

namespace tether::scene::event {

/// A point of the second body with a radius.
struct PointFeature {
  Vector3d at = Vector3d::Zero();
  double radius = 0;

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre,
              double radius_first) const {
    const Jet<double> c = mechanics::point<2>(A, centre), b = mechanics::point<2>(B, at);
    const Vector3d d = c.x - b.x, d1 = c.x1 - b.x1, d2 = c.x2 - b.x2;
    Vector3d n1;
    Touch t = apart(d, d1, d2, radius_first, radius, n1);
    // Between the surfaces, by their radii: at a gap of 0 it is the point of contact.
    t.point = b.x + radius * t.normal;
    t.point_velocity = b.x1 + radius * n1;
    return t;
  }
  double margin(const Frame<double>&, const Frame<double>&, const Vector3d&) const {
    return kInfinity;
  }
};

/// A line of the second body through `at` along `along`, with a radius; from 0 to `length` along
/// it.
struct LineFeature {
  Vector3d at = Vector3d::Zero(), along = Vector3d::UnitX();
  double length = 0, radius = 0;

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre,
              double radius_first) const {
    const Jet<double> c = mechanics::point<2>(A, centre), b = mechanics::point<2>(B, at);
    const Jet<double> e = direction<2>(B, along);
    const Vector3d s = c.x - b.x, s1 = c.x1 - b.x1, s2 = c.x2 - b.x2;
    // d = s - (s.e) e, which is at right angles to e.
    const double k = s.dot(e.x), k1 = s1.dot(e.x) + s.dot(e.x1),
                 k2 = s2.dot(e.x) + 2 * s1.dot(e.x1) + s.dot(e.x2);
    const Vector3d d = s - k * e.x, d1 = s1 - k1 * e.x - k * e.x1,
                   d2 = s2 - k2 * e.x - 2 * k1 * e.x1 - k * e.x2;
    Vector3d n1;
    Touch t = apart(d, d1, d2, radius_first, radius, n1);
    t.point = c.x - radius_first * t.normal;
    t.point_velocity = c.x1 - radius_first * n1;
    return t;
  }
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre) const {
    const Vector3d s = mechanics::point<0>(A, centre).x - mechanics::point<0>(B, at).x;
    const double k = s.dot(times(B.R, along));
    return std::min(k, length - k);
  }
};

/// One potential contact of a scene.
struct FeaturePair {
  int first = 0, second = 0;  ///< bodies, as in Bodies
  Vector3d centre = Vector3d::Zero();
  double radius = 0;            ///< of the first feature, a point
  std::vector<Vector3d> edges;  ///< of the first feature, a vertex: the ways to its neighbours
  std::variant<PlaneFeature, PointFeature, LineFeature, CrossingFeature, RoundOnPlane, RoundOnRound,
               RoundOnLine, PointOnCircle>
      on_second;
  double friction = 0, restitution = 0;
  double rolling = 0, torsional = 0;  ///< m
  double reach = kInfinity;           ///< of both shapes from the centres of their bodies, together

  Touch touch(const Bodies& bodies) const {
    return std::visit(
        [&](const auto& feature) {
          return feature.touch(bodies.frames[at(first)], bodies.frames[at(second)], centre, radius);
        },
        on_second);
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
    const auto* round = std::get_if<RoundOnPlane>(&on_second);
    return round != nullptr && round->is_flush(bodies.frames[at(first)], bodies.frames[at(second)]);
  }
  double margin(const Bodies& bodies) const {
    const Frame<double>&A = bodies.frames[at(first)], &B = bodies.frames[at(second)];
    const double margin =
        std::visit([&](const auto& feature) { return feature.margin(A, B, centre); }, on_second);
    const auto* face = std::get_if<PlaneFeature>(&on_second);
    if (face == nullptr || face->border.empty()) return margin;
    return std::min(margin, out_of_face(B.R * face->normal, A));
  }

 private:
  /// A vertex touches a face whose normal no edge of it goes against. (That of a box which stands
  /// flush on another one is on the border of the other's side faces, too: its edges go into them.)
  double out_of_face(const Vector3d& normal, const Frame<double>& A) const {
    double least = kInfinity;
    for (const Vector3d& way : edges)
      least = std::min(least, kFlush * way.norm() + normal.dot(A.R * way));
    return least;
  }
};

}  // namespace tether::scene::event
