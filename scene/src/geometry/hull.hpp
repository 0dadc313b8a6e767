// Tether: convex hulls of a few points. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace tether::scene {

constexpr std::size_t kMostHullPoints = 64;  ///< the hull is found by trying all triples

/// Corners of each face, counter-clockwise from outside; none if all points lie in one plane.
std::vector<std::vector<std::size_t>> hull_faces(const std::vector<Eigen::Vector3d>& points);

/// Corners of the convex polygon around points in a plane, counter-clockwise.
std::vector<std::size_t> hull_corners(const std::vector<Eigen::Vector2d>& points);

}  // namespace tether::scene
