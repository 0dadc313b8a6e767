// Tether: surfaces of triangles, and heights, from files. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "bounds.hpp"

namespace tether::scene {

/// More belong to no scene.
constexpr std::size_t kMostTriangles = 2 * kMostListed;

/// An error in a file, by line where it has lines.
class SurfaceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct TriangleSurface {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
};

/// Wavefront OBJ: `v` and `f`, whose polygons become fans; all else is passed over.
TriangleSurface parse_obj(std::string_view text);
/// STL, as text or binary; equal corners are one point.
TriangleSurface parse_stl(std::string_view bytes);

struct Heights {
  std::vector<double> values;  // row after row
  int columns = 0;
};
/// Rows of numbers between blanks or commas, at least 2 x 2; # begins a comment.
Heights parse_heights(std::string_view text);

}  // namespace tether::scene
