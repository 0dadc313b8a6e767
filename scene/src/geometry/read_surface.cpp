// Tether: meshes and height fields of a scene file, and the files of surfaces that it names.
// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "bounds.hpp"
#include "geometry/shape_type.hpp"
#include "geometry/surface_files.hpp"

namespace tether::scene::files {

namespace {

// Limits for all bodies together: a file may be named by many, and each reads it.
constexpr std::size_t kMostBytes = 4 * kLargestPart, kMostOfScene = 10 * kMostTriangles;

// Lets `parse(name, text)` read the file that is named; false: it is missing or wrong.
template <class Parse>
bool from_file(Fields& in, Reader& r, const Parse& parse) {
  const std::string name = in.input_name("file");
  if (name.empty()) return false;
  try {
    if (r.surface_bytes > kMostBytes)
      throw SurfaceError(
          "comes after 256 MiB of surfaces that other bodies of the scene have read");
    std::string path;
    const std::string text = read_beside(in.place().file, name, path);
    r.surface_bytes += text.size();
    r.surface_files.insert(path);
    parse(name, text);
  } catch (const SurfaceError& e) {
    in.wrong("file", e.what());
    return false;
  }
  return true;
}

std::vector<std::array<int, 3>> read_triangles(Fields& in, std::size_t points) {
  bool right = true;
  std::vector<std::array<int, 3>> out;
  right = each_row(*in.find("triangles"), 1, kMostTriangles, 3,
                   [&](const Value::Items& corners) {
                     for (const Value& c : corners)
                       right = right && c.whole() && c.number() >= 0 &&
                               c.number() < static_cast<double>(points);
                     const auto corner = [&](std::size_t k) {
                       return right ? static_cast<int>(corners[k].number()) : 0;
                     };
                     out.push_back({corner(0), corner(1), corner(2)});
                   }) &&
          right;
  if (right) return out;
  in.wrong("triangles",
           fmt::format("must be an array of 1 to {} triangles [i, j, k], numbers of points from 0",
                       kMostTriangles));
  return {};
}

// Rows of equal length, at least two of two.
Heights read_rows(Fields& in) {
  const Value& rows = *in.find("heights");
  const std::size_t columns = rows.items().empty() ? 0 : rows.items()[0].items().size();
  Heights out;
  out.columns = static_cast<int>(columns);
  if (columns >= 2 && each_row(rows, 2, kMostListed / columns, columns, [&](const auto& row) {
        for (const Value& each : row) out.values.push_back(each.number());
      }))
    return out;
  in.wrong("heights",
           fmt::format("must be an array of rows of numbers, all of one length, at least "
                       "2 x 2, at most {}, m",
                       kMostListed));
  return {};
}

// Stands for what is wrong.
Shape one_triangle() { return Shape::mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}); }

bool in_range(const Shape& shape) {
  return all_of(shape.points, [](const Eigen::Vector3d& p) {
    return p.allFinite() && p.cwiseAbs().maxCoeff() < 1e100;
  });
}

// All that the bodies of a scene have is bounded, too: few lines repeat a body many times.
bool is_within(Fields& in, Reader& r, const Shape& shape) {
  r.surface_triangles += shape.triangles.size();
  if (r.surface_triangles <= kMostOfScene) return true;
  in.wrong("shape",
           fmt::format("all surfaces of a scene together have at most {} triangles", kMostOfScene));
  return false;
}

bool one_of(Fields& in, const char* inline_key, const char* allowed) {
  if (in.has("file") == in.has(inline_key)) {
    if (in.has("file"))
      in.wrong("file", fmt::format("give file or {}, not both", inline_key));
    else
      in.missing(inline_key, allowed);
    return false;
  }
  return true;
}

}  // namespace

void read_mesh(Fields& in, Reader& r, Shape& shape) {
  shape = one_triangle();
  in.pass_over({"points", "triangles"});
  const double scale = in.number("scale", 1, kPositive, "m in one unit of the points");
  shape.concavity = in.number("concavity", 0, kNotNegative, "m");
  if (!one_of(in, "points", "its corners [[x, y, z], ...], m, and triangles; or a file")) return;
  Shape read = shape;
  if (in.has("points")) {
    if (!in.has("triangles"))
      return in.missing("triangles", "[[i, j, k], ...], numbers of points from 0");
    read.points = in.points("points", 3, kMostListed);
    if (!read.points.empty()) read.triangles = read_triangles(in, read.points.size());
    if (read.points.empty() || read.triangles.empty()) return;
  } else {
    if (in.has("triangles")) return in.wrong("triangles", "are those of the file");
    const bool right = from_file(in, r, [&](const std::string& name, const std::string& text) {
      TriangleSurface surface = parse_triangles(name, text);
      read.points = std::move(surface.points);
      read.triangles = std::move(surface.triangles);
    });
    if (!right) return;
  }
  if (scale != 1)
    for (Eigen::Vector3d& p : read.points) p *= scale;
  if (!in_range(read))
    return in.wrong(in.has("file") ? "file" : "points", "reaches beyond 1e100 m");
  if (all_of(read.triangles, [&](const auto& t) {
        const auto corner = [&](std::size_t k) { return read.points[linalg::at(t[k])]; };
        const Eigen::Vector3d a = corner(1) - corner(0), b = corner(2) - corner(0);
        return !(a.cross(b).stableNorm() > 0);
      }))
    return in.wrong(in.has("file") ? "file" : "triangles", "none of the triangles has an area");
  if (is_within(in, r, read)) shape = std::move(read);
}

std::vector<Shape> read_parts(Fields& in, Reader& r, const Shape& mesh) {
  const Shape& last = r.last_mesh;
  const bool known = last.points == mesh.points && last.triangles == mesh.triangles &&
                     last.concavity == mesh.concavity;
  if (!known) {
    r.last_mesh = mesh;
    r.last_mesh.position.setZero();
    r.last_mesh.orientation.setIdentity();
    r.last_parts.clear();
    try {
      r.last_parts = contact::convex_parts(r.last_mesh);
    } catch (const std::invalid_argument& e) {
      constexpr std::string_view kWhere = "mesh: ";
      const std::string_view what = e.what();
      in.wrong(
          in.has("file") ? "file" : "triangles",
          std::string(what.substr(what.substr(0, kWhere.size()) == kWhere ? kWhere.size() : 0)));
    }
  }
  for (const Shape& part : r.last_parts)
    if (part.points.size() > kMostPoints)
      in.wrong(in.has("file") ? "file" : "triangles",
               fmt::format("a convex part of it has {} corners: the most is {}", part.points.size(),
                           kMostPoints));
  return r.last_parts;
}

void read_height_field(Fields& in, Reader& r, Shape& shape) {
  shape = one_triangle();
  in.pass_over({"heights", "file"});
  const double scale = in.number("scale", 1, kPositive, "m in one unit of the heights");
  if (!in.has("spacing")) return in.missing("spacing", "[along x, along y], m, > 0");
  const std::vector<double> spacing = in.numbers("spacing", {2}, "m");
  if (spacing.empty()) return;
  if (!(spacing[0] > 0 && spacing[1] > 0)) return in.wrong("spacing", "each must be > 0, m");
  if (!one_of(in, "heights", "rows [[z, ...], ...] along x, m; or a file")) return;
  Heights heights;
  if (in.has("heights")) {
    heights = read_rows(in);
  } else {
    from_file(in, r,
              [&](const std::string&, const std::string& text) { heights = parse_heights(text); });
  }
  if (heights.columns == 0) return;
  for (double& each : heights.values) each *= scale;
  Shape read = Shape::height_field(heights.values, heights.columns, spacing[0], spacing[1]);
  if (!in_range(read)) return in.wrong("spacing", "the field reaches beyond 1e100 m");
  if (is_within(in, r, read)) shape = std::move(read);
}

}  // namespace tether::scene::files
