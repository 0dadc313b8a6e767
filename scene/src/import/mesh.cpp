// Tether: meshes of robots. SPDX-License-Identifier: BSD-3-Clause
#include "import/mesh.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <tether/linalg/convex_hull.hpp>

#include "geometry/shape_type.hpp"
#include "geometry/surface_files.hpp"

namespace tether::scene::import {

using Eigen::Vector3d;

std::optional<Shape> read_mesh(const std::string& robot, const std::string& name,
                               const Vector3d& scale, const std::string& of, Remarks& remarks) {
  std::string file = name.substr(0, 7) == "file://" ? name.substr(7) : name;
  constexpr std::string_view kPackage = "package://";
  if (name.substr(0, kPackage.size()) == kPackage)
    file = name.substr(std::min(name.find('/', kPackage.size()), name.size() - 1) + 1);
  try {
    std::string path;
    const std::string bytes = read_beside(robot, file, path);
    TriangleSurface surface = parse_triangles(file, bytes);
    for (Vector3d& p : surface.points) {
      p = p.cwiseProduct(scale);
      if (!(p.cwiseAbs().maxCoeff() < kLargestLength)) throw SurfaceError("reaches too far");
    }
    // A mirror turns triangles inside out.
    if (scale.prod() < 0)
      for (std::array<int, 3>& t : surface.triangles) std::swap(t[0], t[1]);
    return Shape::mesh(std::move(surface.points), std::move(surface.triangles));
  } catch (const SurfaceError& e) {
    remarks.add(fmt::format("left out ({}): <mesh>", e.what()), of);
    return {};
  }
}

std::optional<Shape> hull_of(const Shape& mesh, const std::string& of, Remarks& remarks) {
  std::vector<char> is_corner(mesh.points.size(), 0);
  for (const std::vector<std::size_t>& face : linalg::hull_faces(mesh.points))
    for (const std::size_t k : face) is_corner[k] = 1;
  Shape out = Shape::convex({});
  for (std::size_t k = 0; k < is_corner.size(); ++k)
    if (is_corner[k] != 0) out.points.push_back(mesh.points[k]);
  if (!out.points.empty() && out.points.size() <= kMostPoints) return out;
  remarks.add(out.points.empty() ? "left out, as it is flat: <mesh>"
                                 : "left out, as its hull has too many corners: <mesh>",
              of);
  return {};
}

std::vector<Shape> parts_of(const Shape& mesh, const std::string& of, Remarks& remarks) {
  try {
    std::vector<Shape> parts = contact::convex_parts(mesh);
    if (all_of(parts, [](const Shape& s) { return s.points.size() <= kMostPoints; })) {
      remarks.add(fmt::format("meshes as convex parts, {} here", parts.size()), of);
      return parts;
    }
  } catch (const std::invalid_argument& e) {
    remarks.add(fmt::format("meshes as their hulls, since {}", e.what()), of);
  }
  const std::optional<Shape> hull = hull_of(mesh, of, remarks);
  return hull ? std::vector<Shape>{*hull} : std::vector<Shape>();
}

}  // namespace tether::scene::import
