// Tether: planes and faces that points touch, and round things. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "touch.hpp"

namespace tether::scene::event {

/// The half-space n.(x - b) <= 0 of the second body, or a face of it: where all border.x <= limit.
struct PlaneFeature {
  Vector3d at = Vector3d::Zero(), normal = Vector3d::UnitZ();
  std::vector<std::pair<Vector3d, double>> border;  ///< in the axes of the body

  Touch look(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre,
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
    double least = kNoBorder;
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

}  // namespace tether::scene::event
