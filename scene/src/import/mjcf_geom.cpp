// Tether: geoms of MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// Sizes of MJCF are halves: of edges, of the height of a cylinder, of the way between the centres
// of a capsule's caps.
#include "mjcf_geom.hpp"

#include <fmt/format.h>

#include <tether/linalg/shortest_turn.hpp>

#include "geometry/shape_type.hpp"
#include "mesh.hpp"

namespace tether::scene::import::mjcf {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// Volume and inertia of density 1 in the axes of the geom, and the shape that touches.
struct Solid {
  double volume = 0;
  Matrix3d inertia = Matrix3d::Zero();
  std::optional<Shape> shape;
  Vector3d centre = Vector3d::Zero();
};

Solid of_shape(const Shape& shape) {
  const MassProperties properties = mass_properties(shape);
  return {properties.volume, properties.inertia, shape, properties.centre};
}

/// As in MuJoCo a mesh touches as its hull, and weighs as what is within its surface.
Solid read_mesh_solid(const Settings& settings, const std::string& name, const std::string& geom,
                      bool touches, Remarks& remarks) {
  const auto found = settings.meshes.find(name);
  if (found == settings.meshes.end() || found->second.points.empty()) return {};
  const Shape& mesh = found->second;
  if (!touches) {  // hulls of what only shows would take the longest
    Solid out = of_shape(mesh);
    out.shape.reset();
    return out;
  }
  const std::optional<Shape> hull = hull_of(mesh, geom, remarks);
  if (!hull) return {};
  remarks.add("meshes touch as their convex hulls", geom);
  Solid out = of_shape(mesh.triangles.empty() ? *hull : mesh);
  out.shape = hull;
  return out;
}

/// The numbers of `size` from `from` on, which must be there and > 0.
bool sizes(Tag& tag, const std::vector<double>& size, std::size_t count) {
  bool good = size.size() >= count;
  for (std::size_t k = 0; good && k < count; ++k) good = size[k] > 0 && size[k] < kLargestLength;
  if (!good)
    tag.wrong("size", fmt::format("must have {}, > 0, here",
                                  count == 1 ? "a number" : fmt::format("{} numbers", count)));
  return good;
}

Solid read_solid(Tag& tag, const std::string& type, const std::vector<double>& size) {
  Shape shape;
  if (type == "sphere" && sizes(tag, size, 1)) {
    shape.radius = size[0];
    return of_shape(shape);
  }
  if (type == "box" && sizes(tag, size, 3)) {
    shape.kind = ShapeKind::box;
    shape.size = 2 * Vector3d(size[0], size[1], size[2]);
    return of_shape(shape);
  }
  if ((type == "cylinder" || type == "capsule") && sizes(tag, size, 2)) {
    shape.kind = type == "cylinder" ? ShapeKind::cylinder : ShapeKind::capsule;
    shape.radius = size[0];
    shape.length = 2 * size[1];
    return of_shape(shape);
  }
  if (type == "ellipsoid" && sizes(tag, size, 3)) {
    shape.kind = ShapeKind::ellipsoid;
    shape.size = Vector3d(size[0], size[1], size[2]);
    return of_shape(shape);
  }
  return {};
}

/// Ends of the axis in place of size, position and orientation. As in MuJoCo the z axis of the geom
/// points from the second to the first of them, which turns the edges of boxes.
Eigen::Isometry3d read_place(Tag& tag, const std::string& type, const Settings& settings,
                             std::vector<double>& size) {
  const std::vector<double> ends = tag.numbers("fromto", 6, 6);
  if (ends.empty()) {
    const Vector3d at = tag.vector("pos", Vector3d::Zero());
    return placed(read_orientation(tag, settings), at);
  }
  const Vector3d from(ends[0], ends[1], ends[2]), to(ends[3], ends[4], ends[5]);
  if (!((to - from).stableNorm() > 0)) tag.wrong("fromto", "must be two points");
  if (size.empty()) size.push_back(0);  // reported by `sizes`
  size.resize(1);
  if (type == "box" || type == "ellipsoid") size.push_back(size[0]);
  size.push_back((to - from).stableNorm() / 2);
  return placed(linalg::shortest_turn(Vector3d::UnitZ(), from - to), (from + to) / 2);
}

Touch read_touch(Tag& tag, bool& touches) {
  Touch out;
  const std::vector<double> friction = tag.numbers("friction", 1, 3);
  out.friction = friction.empty() ? 1 : friction[0];
  if (!(out.friction >= 0)) tag.wrong("friction", "must be >= 0");
  const double condim = tag.number("condim", 3);
  if (condim != 1 && condim != 3 && condim != 4 && condim != 6)
    tag.wrong("condim", "must be 1, 3, 4 or 6");
  out.tangential = condim > 1;
  const auto bits = [&](const char* key) {
    const double value = tag.number(key, 1);
    if (!(value >= 0 && value < 4294967296.0 && value == std::floor(value))) {
      tag.wrong(key, "must be a whole number of 32 bits");
      return 1U;
    }
    return static_cast<unsigned>(value);
  };
  out.type = bits("contype");
  out.affinity = bits("conaffinity");
  touches = out.type != 0 || out.affinity != 0;
  return out;
}

}  // namespace

Geom read_geom(const Node& node, const std::string& class_name, const Settings& settings,
               Problems& problems, Remarks& remarks) {
  Tag own(node, problems);
  Tag tag(node, problems, settings.defaults(node, own.text("class", class_name), problems));
  Geom out;
  out.name = tag.text("name");
  if (tag.has("name")) tag.name("name", "");
  std::string type = tag.text("type", "sphere");
  if (tag.has("mesh") && !tag.has("type")) type = "mesh";
  std::vector<double> size = tag.numbers("size", 1, 3);
  const Eigen::Isometry3d place = read_place(tag, type, settings, size);
  out.touch = read_touch(tag, out.touches);
  const double group = tag.number("group", 0), density = tag.not_negative("density", 1000);
  out.has_mass = group >= settings.least_group && group <= settings.most_group && type != "plane";

  Solid solid;
  if (type == "plane") {
    solid.shape.emplace().kind = ShapeKind::plane;
  } else if (type == "mesh" || type == "hfield" || type == "sdf") {
    if (type == "mesh")
      solid = read_mesh_solid(settings, tag.text("mesh"), name_or_line(node), out.touches, remarks);
    if (!solid.shape) remarks.add(fmt::format("geoms of type {}", type), name_or_line(node));
    const bool weighs = !tag.has("mass") || tag.number("mass", 0) > 0;
    if (!(solid.volume > 0) && weighs) out.mass = -1;  // nobody knows
  } else if (type != "sphere" && type != "capsule" && type != "box" && type != "cylinder" &&
             type != "ellipsoid") {
    tag.wrong("type", "must be plane, sphere, capsule, cylinder, box, ellipsoid, mesh or hfield");
  } else {
    solid = read_solid(tag, type, size);
  }
  const double mass = tag.has("mass") ? tag.not_negative("mass", 0) : density * solid.volume;
  if (solid.volume > 0) {
    const Matrix3d R = place.linear(), turned = R * solid.inertia * R.transpose();
    out.mass = mass;
    out.inertia = mass / solid.volume / 2 * (turned + turned.transpose());
    out.centre = place * solid.centre;
  }
  if (solid.shape) {
    out.shape = std::move(solid.shape);
    out.shape->position = place.translation();
    if (place.linear() != Matrix3d::Identity()) out.shape->orientation = place.linear();
  }
  tag.finish(remarks, {"class", "rgba", "material", "user", "mesh", "hfield", "fitscale"});
  return out;
}

}  // namespace tether::scene::import::mjcf
