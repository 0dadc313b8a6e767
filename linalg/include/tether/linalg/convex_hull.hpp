// Tether: convex hulls of points. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// Corners of each face of the hull, counter-clockwise from outside; none if all points lie in one
/// plane. What is nearer to the plane of a face than 1e-7 of their extent lies in it.
std::vector<std::vector<std::size_t>> hull_faces(const std::vector<Eigen::Vector3d>& points);

/// The points that are corners of faces, in their order.
std::vector<Eigen::Vector3d> points_of_faces(const std::vector<Eigen::Vector3d>& points,
                                             const std::vector<std::vector<std::size_t>>& faces);

/// Corners of the convex polygon around points in a plane, counter-clockwise.
std::vector<std::size_t> hull_corners(const std::vector<Eigen::Vector2d>& points);

}  // namespace tether::linalg
TETHER_EXPORT_END
