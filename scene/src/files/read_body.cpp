// Tether: bodies of a scene file. SPDX-License-Identifier: BSD-3-Clause

#include <cmath>
#include <filesystem>
#include <fstream>

#include "geometry/mass.hpp"
#include "geometry/surface_files.hpp"
#include "read.hpp"
#include "read_surface.hpp"

namespace tether::scene::files {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestFile = std::size_t{64} << 20;
// Limits for all bodies together: a file may be named by many, and each reads it.
constexpr std::size_t kMostBytes = 4 * kLargestFile, kMostOfScene = 10 * kMostTriangles;

// A scene from an untrusted source reads nothing but what lies beside it: no way out of its folder,
// by a link either, and no device.
bool read_beside(Fields& in, Reader& r, const std::string& name, std::string& text) {
  std::error_code error;
  const fs::path folder = fs::path(in.place().file).parent_path();
  const fs::path base = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path file = error ? fs::path() : fs::canonical(base / name, error);
  if (error || !fs::is_regular_file(file, error)) {
    in.wrong("file", "there is no such file beside the scene");
    return false;
  }
  if (std::mismatch(base.begin(), base.end(), file.begin(), file.end()).first != base.end()) {
    in.wrong("file", "must lie in the folder of the scene, or below it");
    return false;
  }
  if (r.surface_bytes > kMostBytes) {
    in.wrong("file", "comes after 256 MiB of surfaces that other bodies of the scene have read");
    return false;
  }
  std::ifstream stream(file, std::ios::binary);
  text = read_stream(stream, kLargestFile);
  r.surface_bytes += text.size();
  r.surface_files.insert(file.string());
  if (stream.bad() || !stream.eof() || text.size() > kLargestFile) {
    in.wrong("file", "cannot be read, or is larger than 64 MiB");
    return false;
  }
  return true;
}

// Lets `parse(name, text)` read the file that is named; false: it is missing or wrong.
template <class Parse>
bool from_file(Fields& in, Reader& r, const Parse& parse) {
  const std::string name = in.input_name("file");
  std::string text;
  if (name.empty() || !read_beside(in, r, name, text)) return false;
  try {
    parse(fs::path(name).extension().string(), text);
  } catch (const SurfaceError& e) {
    in.wrong("file", e.what());
    return false;
  }
  return true;
}

bool is_number(const Value& v) { return v.kind() == Value::Kind::number && kAny.holds(v.number()); }

std::vector<std::array<int, 3>> read_triangles(Fields& in, std::size_t points) {
  const Value* value = in.find("triangles");
  bool right = value->kind() == Value::Kind::array && !value->items().empty() &&
               value->items().size() <= kMostTriangles;
  std::vector<std::array<int, 3>> out;
  for (std::size_t k = 0; right && k < value->items().size(); ++k) {
    const std::vector<Value>& corners = value->items()[k].items();
    right = corners.size() == 3;
    for (const Value& c : corners)
      right = right && is_number(c) && c.whole() && c.number() >= 0 &&
              c.number() < static_cast<double>(points);
    if (right)
      out.push_back({static_cast<int>(corners[0].number()), static_cast<int>(corners[1].number()),
                     static_cast<int>(corners[2].number())});
  }
  if (right) return out;
  in.wrong("triangles",
           fmt::format("must be an array of 1 to {} triangles [i, j, k], numbers of points from 0",
                       kMostTriangles));
  return {};
}

// Rows of equal length, at least two of two.
Heights read_rows(Fields& in) {
  const Value* value = in.find("heights");
  Heights out;
  bool right = value->kind() == Value::Kind::array && value->items().size() >= 2;
  for (std::size_t k = 0; right && k < value->items().size(); ++k) {
    const std::vector<Value>& row = value->items()[k].items();
    if (k == 0) out.columns = static_cast<int>(row.size());
    right = row.size() >= 2 && static_cast<int>(row.size()) == out.columns &&
            out.values.size() + row.size() <= kMostMeshPoints &&
            std::all_of(row.begin(), row.end(), is_number);
    if (right)
      for (const Value& each : row) out.values.push_back(each.number());
  }
  if (right) return out;
  in.wrong("heights",
           fmt::format("must be an array of rows of numbers, all of one length, at least "
                       "2 x 2, at most {}, m",
                       kMostMeshPoints));
  return {};
}

// Stands for what is wrong.
Shape one_triangle() { return Shape::mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}); }

bool in_range(const Shape& shape) {
  return std::all_of(shape.points.begin(), shape.points.end(), [](const Eigen::Vector3d& p) {
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

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kMostPoints = 4096;

void required(Fields& in, std::string_view key, std::string_view allowed) {
  if (!in.has(key)) in.missing(key, std::string(allowed));
}

// wxyz, or an axis with deg or rad.
Eigen::Quaterniond read_orientation(Fields& in, const Reader& r) {
  const Value* table = in.table("orientation");
  if (table == nullptr) return Eigen::Quaterniond::Identity();
  Fields fields = r.fields(table, in.path() + ": orientation");
  Eigen::Quaterniond out = Eigen::Quaterniond::Identity();
  if (fields.has("wxyz")) {
    const std::vector<double> q = fields.numbers("wxyz", {4}, "");
    if (!q.empty()) {
      const Eigen::Quaterniond read(q[0], q[1], q[2], q[3]);
      const double length = read.coeffs().stableNorm();
      // Digits cut off are mended; anything else is a mistake.
      if (std::abs(length - 1) <= 1e-15)
        out = read;
      else if (std::abs(length - 1) <= 1e-3)
        out.coeffs() = read.coeffs() / length;
      else
        fields.wrong("wxyz", "must have length 1 (unit quaternion, scalar first)");
    }
  } else {
    if (!fields.has("axis"))
      fields.missing("axis", "give axis and deg (or rad), or wxyz (scalar first)");
    const Vector3d axis = fields.direction("axis", Vector3d::UnitZ());
    if (!fields.has("deg") && !fields.has("rad")) fields.missing("deg", "give deg or rad");
    out = Eigen::AngleAxisd(fields.angle("", 0), axis);
  }
  fields.finish();
  return out;
}

// The fields of a shape; `in` is the body itself for a body's only shape.
Shape read_shape(Fields& in, Reader& r) {
  Shape shape;
  required(in, "shape",
           "it is a sphere, plane, box, capsule, ellipsoid, cylinder, convex, points, mesh or "
           "height_field");
  // A height field is a mesh by another description.
  std::vector<std::string> words;
  for (const ShapeKind each : contact::kShapeKinds) words.emplace_back(name(each));
  words.emplace_back("height_field");
  const int kind = in.choice("shape", words);
  if (kind < 0) {
    in.pass_over({"radius", "length", "size", "half_axes", "normal", "points", "triangles", "file",
                  "heights", "spacing", "scale"});
    shape.radius = 1;
    return shape;
  }
  if (words[static_cast<std::size_t>(kind)] == "height_field") {
    read_height_field(in, r, shape);
    return shape;
  }
  shape.kind = contact::kShapeKinds[static_cast<std::size_t>(kind)];
  // Keys of other kinds stay unknown: a box with a radius is a mistake.
  switch (shape.kind) {
    case ShapeKind::capsule:
    case ShapeKind::cylinder:
      required(in, "length",
               shape.kind == ShapeKind::capsule ? "between the centres of the caps, m, > 0"
                                                : "of the whole cylinder, m, > 0");
      shape.length = in.number("length", 1, kPositive, "m");
      [[fallthrough]];
    case ShapeKind::sphere:
      required(in, "radius", "m, > 0");
      shape.radius = in.number("radius", 1, kPositive, "m");
      break;
    case ShapeKind::plane:
      shape.normal = in.direction("normal", Vector3d::UnitZ());
      break;
    case ShapeKind::box:
      required(in, "size", "the full edges [x, y, z], m, > 0");
      shape.size = in.vector("size", Vector3d::Ones(), kPositive, "m (full edges)");
      break;
    case ShapeKind::ellipsoid:
      required(in, "half_axes", "[x, y, z], m, > 0");
      shape.size = in.vector("half_axes", Vector3d::Ones(), kPositive, "m");
      break;
    case ShapeKind::convex:
      required(in, "points", "its corners [[x, y, z], ...], m");
      shape.points = in.points("points", 4, kMostPoints);
      break;
    case ShapeKind::points:
      required(in, "points", "the points that touch [[x, y, z], ...], m");
      shape.points = in.points("points", 1, kMostPoints);
      break;
    case ShapeKind::mesh:
      read_mesh(in, r, shape);
      break;
  }
  return shape;
}

std::vector<Shape> read_shapes(Fields& in, Reader& r) {
  std::vector<Shape> shapes;
  const bool several = in.has("shapes");
  if (several && in.has("shape")) in.wrong("shape", "give shape or shapes, not both");
  if (!several) {
    if (in.has("shape")) shapes.push_back(read_shape(in, r));
    return shapes;
  }
  for (const Value* each : in.tables("shapes")) {
    Fields fields = r.fields(each, fmt::format("{}: shape {}", in.path(), shapes.size() + 1));
    Shape shape = read_shape(fields, r);
    shape.position = fields.vector("position", Vector3d::Zero(), kAny, "m");
    shape.orientation = read_orientation(fields, r);
    fields.finish();
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

void read_mass(Fields& in, Body& body) {
  const bool by_mass = in.has("mass"), by_density = in.has("density"),
             by_inertia = in.has("inertia");
  body.mass =
      in.number("mass", body.fixed || by_mass ? 0 : 1, body.fixed ? kNotNegative : kPositive, "kg");
  const double density = in.number("density", 1, kPositive, "kg/m^3");
  if (by_mass && by_density) in.wrong("density", "give mass or density, not both");
  if (!by_mass && !by_density && !body.fixed)
    in.missing("mass", "give mass (kg) or density (kg/m^3), or fixed = true");

  const std::vector<double> moments = in.numbers("inertia", {3, 6}, "kg m^2");
  if (by_inertia && !moments.empty()) {
    Matrix3d inertia = Vector3d(moments[0], moments[1], moments[2]).asDiagonal();
    if (moments.size() == 6) {
      inertia(0, 1) = inertia(1, 0) = moments[3];
      inertia(0, 2) = inertia(2, 0) = moments[4];
      inertia(1, 2) = inertia(2, 1) = moments[5];
    }
    const bool none = body.fixed && inertia.isZero(0);
    if (!none && !is_inertia(inertia))
      in.wrong("inertia",
               "principal moments must be > 0 and each at most the sum of the other two (triangle "
               "inequality), kg m^2");
    body.inertia = inertia;
  }
  const bool from_shapes = by_density || (by_mass && !by_inertia && body.mass > 0);
  if (!from_shapes) return;

  const char* const advice = by_density ? "density" : "inertia";
  const MassProperties solid = mass_properties(body.shapes);
  if (!(solid.volume > 0) || !std::isfinite(solid.volume)) {
    const std::string why = body.shapes.empty() ? "there is no shape to take it from"
                                                : "the shapes have no (finite) volume";
    if (by_density)
      in.wrong(advice, why + "; give mass and inertia");
    else
      in.missing(advice, "[xx, yy, zz] about the centre, body axes, kg m^2: " + why);
    return;
  }
  if (by_density) body.mass = density * solid.volume;
  if (by_inertia) return;
  body.inertia = body.mass / solid.volume * solid.inertia;
  double size = 0;
  for (const Shape& shape : body.shapes) {
    size = std::max({size, shape.radius, shape.length, shape.size.maxCoeff()});
    for (const Vector3d& p : shape.points) size = std::max(size, p.norm());
  }
  if (!(solid.centre.norm() <= 1e-6 * size)) {
    const Vector3d& c = solid.centre;
    in.missing("inertia",
               fmt::format("the body's origin must be its centre of mass, but the shapes' centre "
                           "is [{}, {}, {}]; move the shapes by its negative, or give mass and "
                           "inertia",
                           c.x(), c.y(), c.z()));
    return;
  }
  if (!is_inertia(body.inertia))
    in.missing("inertia", "that of the shapes is not a finite number > 0");
}

}  // namespace

void read_mesh(Fields& in, Reader& r, Shape& shape) {
  shape = one_triangle();
  in.pass_over({"points", "triangles"});
  const double scale = in.number("scale", 1, kPositive, "m in one unit of the points");
  if (!one_of(in, "points", "its corners [[x, y, z], ...], m, and triangles; or a file")) return;
  Shape read = shape;
  if (in.has("points")) {
    if (!in.has("triangles"))
      return in.missing("triangles", "[[i, j, k], ...], numbers of points from 0");
    read.points = in.points("points", 3, kMostMeshPoints);
    if (!read.points.empty()) read.triangles = read_triangles(in, read.points.size());
    if (read.points.empty() || read.triangles.empty()) return;
  } else {
    if (in.has("triangles")) return in.wrong("triangles", "are those of the file");
    const bool right = from_file(in, r, [&](const std::string& ending, const std::string& text) {
      if (ending != ".obj" && ending != ".stl")
        throw SurfaceError("must end in .obj or .stl: no other mesh is read");
      TriangleSurface surface = ending == ".obj" ? parse_obj(text) : parse_stl(text);
      read.points = std::move(surface.points);
      read.triangles = std::move(surface.triangles);
    });
    if (!right) return;
  }
  if (scale != 1)
    for (Eigen::Vector3d& p : read.points) p *= scale;
  if (!in_range(read))
    return in.wrong(in.has("file") ? "file" : "points", "reaches beyond 1e100 m");
  if (std::all_of(read.triangles.begin(), read.triangles.end(), [&](const auto& t) {
        const auto corner = [&](std::size_t k) { return read.points[linalg::at(t[k])]; };
        const Eigen::Vector3d a = corner(1) - corner(0), b = corner(2) - corner(0);
        return !(a.cross(b).stableNorm() > 0);
      }))
    return in.wrong(in.has("file") ? "file" : "triangles", "none of the triangles has an area");
  if (is_within(in, r, read)) shape = std::move(read);
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

Body read_body(Fields& in, Reader& r) {
  Body body;
  body.place = in.place();
  body.name = in.name("name", in.path());
  if (in.has("name")) in.rename(fmt::format("body \"{}\"", body.name));
  body.fixed = in.flag("fixed", false);
  body.shapes = read_shapes(in, r);
  read_mass(in, body);
  body.position = in.vector("position", Vector3d::Zero(), kAny, "m");
  body.orientation = read_orientation(in, r);
  body.velocity = in.vector("velocity", Vector3d::Zero(), kAny, "m/s");
  body.angular_velocity = in.vector("angular_velocity", Vector3d::Zero(), kAny, "rad/s");
  body.material = in.name("material", "");
  return body;
}

}  // namespace tether::scene::files
