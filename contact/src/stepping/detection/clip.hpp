// Tether: polygons cut by planes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>

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

}  // namespace tether::contact::detail
