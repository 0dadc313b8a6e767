// Tether: polygons cut by planes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace tether::contact::detail {

/// Cuts a polygon, or a line of two corners, to the half-space inward . (x - on_plane) >= 0. Calls
/// keep(k) for each corner inside, and cut(k, next, point, leaves) where the edge from corner k to
/// the next one passes the plane. Both follow from the same two distances, so that a cut lies
/// between the ends of its edge even where the edge lies in the plane up to rounding.
template <class Point, class Keep, class Cut>
void cut_polygon(std::size_t corners, const Eigen::Vector3d& inward,
                 const Eigen::Vector3d& on_plane, const Point& point, const Keep& keep,
                 const Cut& cut) {
  for (std::size_t k = 0; k < corners; ++k) {
    const std::size_t next = k + 1 == corners ? 0 : k + 1;
    const Eigen::Vector3d &p = point(k), &q = point(next);
    const double d = inward.dot(p - on_plane), e = inward.dot(q - on_plane);
    if (d >= 0) keep(k);
    if ((d >= 0) == (e >= 0)) continue;
    if (corners == 2 && k == 1) continue;  // the same line, back
    cut(k, next, Eigen::Vector3d(p + d / (d - e) * (q - p)), d >= 0);
  }
}

using Polygon = std::vector<Eigen::Vector3d>;

/// Cuts a convex polygon by the plane normal . x = offset in two. Corners that are nearer to the
/// plane than `same` lie in it: they belong to both, and are added to `in_plane`. The polygons on
/// both sides of an edge get the same point.
inline void split_polygon(const Polygon& polygon, const Eigen::Vector3d& normal, double offset,
                          double same, Polygon& below, Polygon& above,
                          Polygon* in_plane = nullptr) {
  below.clear();
  above.clear();
  const auto share = [&](const Eigen::Vector3d& x) {
    below.push_back(x);
    above.push_back(x);
    if (in_plane != nullptr) in_plane->push_back(x);
  };
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector3d &p = polygon[k], &q = polygon[(k + 1) % polygon.size()];
    const double d = normal.dot(p) - offset, e = normal.dot(q) - offset;
    if (std::abs(d) <= same)
      share(p);
    else
      (d < 0 ? below : above).push_back(p);
    if (!(std::min(d, e) < -same && std::max(d, e) > same)) continue;
    // From the lower end, whatever the direction of the edge is.
    const Eigen::Vector3d &low = d < e ? p : q, &high = d < e ? q : p;
    share(low + std::min(d, e) / (std::min(d, e) - std::max(d, e)) * (high - low));
  }
}

}  // namespace tether::contact::detail
