// Tether: files of surfaces: OBJ, STL, MSH and heights. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tether/export.hpp>
#include <vector>

#include "bounds.hpp"

namespace tether::scene {

/// More belong to no scene.
constexpr std::size_t kMostTriangles = 2 * kMostListed;

/// The importer, a library of its own, reads them, too.
TETHER_EXPORT_BEGIN

/// An error in a file, by line where it has lines.
class SurfaceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct TriangleSurface {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
};

struct Heights {
  std::vector<double> values;  // row after row
  int columns = 0;
};

/// The bytes of `name`, seen from the folder of the file `of`: a file in that folder, or in
/// `within` where it is not empty, or below, of at most 64 MiB; `path` gets the place. Throws
/// SurfaceError.
std::string read_beside(const std::string& of, const std::string& name, std::string& path,
                        const std::string& within = {});

/// The triangles of an .obj, .stl or .msh; equal corners of an STL are one point. Throws
/// SurfaceError.
TriangleSurface parse_triangles(const std::string& name, std::string_view bytes);

TETHER_EXPORT_END

/// Rows of numbers between blanks or commas, at least 2 x 2; # begins a comment.
Heights parse_heights(std::string_view text);

}  // namespace tether::scene
