// Tether: meshes of robots. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <tether/linalg/convex_hull.hpp>

#include "geometry/surface_files.hpp"
#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import {

namespace {

std::string without(std::string_view prefix, const std::string& name) {
  return name.substr(0, prefix.size()) == prefix ? name.substr(prefix.size()) : "";
}

// package://name/file is file in the folder of the robot, then name/file and file in those
// above it up to the folder of all files.
std::string find_file(const Problems& robot, const std::string& name) {
  namespace fs = std::filesystem;
  if (const std::string file = without("file://", name); !file.empty()) return file;
  const std::string in_packages = without("package://", name);
  if (in_packages.empty()) return name;
  const std::string in_package =
      in_packages.substr(std::min(in_packages.find('/'), in_packages.size() - 1) + 1);
  std::error_code error;
  const fs::path folder = fs::absolute(robot.file(), error).parent_path();
  const fs::path depth =
      robot.folder().empty() ? fs::path(".") : fs::relative(folder, robot.folder(), error);
  fs::path up;
  for (auto step = depth.begin(); step != depth.end(); ++step, up /= "..")
    for (const fs::path& each : {up / in_package, up / in_packages, up / ".." / in_packages})
      if (fs::is_regular_file(folder / each, error)) return each.string();
  return in_package;
}

}  // namespace

std::optional<Shape> read_mesh(const Problems& robot, const std::string& name,
                               const Vector3d& scale, const std::string& of, Remarks& remarks) {
  const std::string file = find_file(robot, name);
  try {
    std::string path;
    const std::string bytes = read_beside(robot.file(), file, path, robot.folder());
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

namespace {

constexpr double kNearHull = 1e-3;  // of the extent: what hulls leave out of a mesh at most
constexpr double kFarthest = 0.1;   // of the extent: beyond, no hull is found
constexpr double kInPlane = 1e-7;   // of the extent: as linalg::hull_faces()

using Faces = std::vector<std::vector<std::size_t>>;

/// The points that are farthest above the faces of the hull of `corners`, each by more than `most`.
std::vector<Vector3d> farthest_above(const std::vector<Vector3d>& corners, const Faces& faces,
                                     const std::vector<Vector3d>& points, double most) {
  std::vector<Vector3d> out;
  for (const std::vector<std::size_t>& face : faces) {
    const Vector3d& on = corners[face[0]];
    Vector3d area = Vector3d::Zero();
    for (std::size_t k = 2; k < face.size(); ++k)
      area += (corners[face[k - 1]] - on).cross(corners[face[k]] - on);
    const Vector3d normal = area.stableNormalized();
    double height = most;
    const Vector3d* farthest = nullptr;
    for (const Vector3d& p : points) {
      const double above = normal.dot(p - on);
      if (!(above > height)) continue;
      height = above;
      farthest = &p;
    }
    if (farthest != nullptr) out.push_back(*farthest);
  }
  return out;
}

/// Each edge has a face on both sides: rounding may leave one out where points hardly leave a
/// plane.
bool is_closed(const Faces& faces) {
  std::set<std::pair<std::size_t, std::size_t>> edges;
  for (const std::vector<std::size_t>& face : faces)
    for (std::size_t k = 0; k < face.size(); ++k)
      if (!edges.insert({face[k], face[(k + 1) % face.size()]}).second) return false;
  return all_of(edges, [&](const auto& e) { return edges.count({e.second, e.first}) > 0; });
}

struct MeshHull {
  std::vector<Vector3d> corners;  // none: it is flat
  double left_out = 0;            // of the extent: how far points may be above it
};

/// Corners that grow from six points until no point is farther above their hull than `near`: a hull
/// of all points takes the product of points and faces. None where it is flat.
MeshHull near_hull(const std::vector<Vector3d>& points, double near) {
  Vector3d low = points.front(), high = low;
  for (const Vector3d& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double extent = (high - low).maxCoeff();
  std::vector<Vector3d> some;
  // Directions between the edges of a box, since most meshes have many points in its sides.
  for (const Vector3d& u : {Vector3d(3, 2, 1), Vector3d(-1, 3, 2), Vector3d(-2, -1, 3)})
    for (const double side : {-1.0, 1.0})
      some.push_back(*std::max_element(
          points.begin(), points.end(),
          [&](const Vector3d& a, const Vector3d& b) { return side * u.dot(a - b) < 0; }));
  while (some.size() <= kMostPoints) {
    const Faces faces = linalg::hull_faces(some);
    if (faces.empty()) return {linalg::points_of_faces(points, linalg::hull_faces(points))};
    const std::vector<Vector3d> more = farthest_above(some, faces, points, near * extent);
    if (more.empty()) {
      const bool is_exact = farthest_above(some, faces, points, kInPlane * extent).empty();
      return {linalg::points_of_faces(some, faces), is_exact ? 0 : near};
    }
    some.insert(some.end(), more.begin(), more.end());
  }
  return {some};
}

}  // namespace

std::optional<Shape> hull_of(const Shape& mesh, const std::string& of, Remarks& remarks) {
  MeshHull hull = near_hull(mesh.points, kNearHull);
  for (double near = 2 * kNearHull; near < kFarthest && hull.corners.size() <= kMostPoints &&
                                    !is_closed(linalg::hull_faces(hull.corners));
       near *= 2)
    hull = near_hull(mesh.points, near);
  Shape out = Shape::convex(std::move(hull.corners));
  out.position = mesh.position;
  out.orientation = mesh.orientation;
  if (hull.left_out > 0)
    remarks.add(fmt::format("hulls of meshes within {} of their extent", hull.left_out), of);
  if (!out.points.empty() && out.points.size() <= kMostPoints) return out;
  remarks.add(out.points.empty() ? "left out, as it is flat: <mesh>"
                                 : "left out, as its hull has too many corners: <mesh>",
              of);
  return {};
}

namespace {

std::vector<Shape> parts_of(const Shape& mesh, bool as_hull, const std::string& of,
                            Remarks& remarks) {
  try {
    std::vector<Shape> parts;
    if (!as_hull) parts = contact::convex_parts(mesh);
    if (!parts.empty() &&
        all_of(parts, [](const Shape& s) { return s.points.size() <= kMostPoints; })) {
      remarks.add(fmt::format("meshes as convex parts, {} here", parts.size()), of);
      return parts;
    }
    remarks.add("meshes as their hulls", of);
  } catch (const std::invalid_argument& e) {
    remarks.add(fmt::format("meshes as their hulls, since {}", e.what()), of);
  }
  const std::optional<Shape> hull = hull_of(mesh, of, remarks);
  return hull ? std::vector<Shape>{*hull} : std::vector<Shape>();
}

}  // namespace

void make_convex(Model& model, bool as_hulls) {
  for (Link& link : model.links) {
    std::vector<Shape> shapes;
    for (Shape& shape : link.shapes) {
      if (shape.kind != ShapeKind::mesh) {
        shapes.push_back(std::move(shape));
        continue;
      }
      for (Shape& part : parts_of(shape, as_hulls, link.name, model.remarks))
        shapes.push_back(std::move(part));
    }
    link.shapes = std::move(shapes);
  }
}

}  // namespace tether::scene::import
