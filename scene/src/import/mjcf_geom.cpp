// Tether: geoms of MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// Sizes of MJCF are halves: of edges, of the height of a cylinder, of the way between the centres
// of a capsule's caps.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tether/linalg/shortest_turn.hpp>

#include "mjcf.hpp"

namespace tether::scene::import::mjcf {

namespace {

/// Volume and inertia of density 1 in the axes of the geom, and the shape that touches.
struct Solid : MassProperties {
  std::optional<Shape> shape;
};

Solid of_shape(const Shape& shape) { return {mass_properties(shape), shape}; }

/// As in MuJoCo a mesh touches as its hull, and weighs as what is within its surface.
Solid read_mesh_solid(const Settings& settings, const std::string& name, const std::string& geom,
                      bool touches, Remarks& remarks) {
  const auto found = settings.meshes.find(name);
  if (found == settings.meshes.end() || found->second.points.empty()) return {};
  const Shape& mesh = found->second;
  if (!touches) return {mass_properties(mesh), {}};  // hulls of what only shows take the longest
  const std::optional<Shape> hull = hull_of(mesh, geom, remarks);
  if (!hull) return {};
  remarks.add("meshes touch as their convex hulls", geom);
  return {mass_properties(mesh.triangles.empty() ? *hull : mesh), hull};
}

/// Kinds of geoms with sizes, and how many numbers these have.
struct SizedKind {
  const char* name;
  ShapeKind kind;
  std::size_t sizes;
};
constexpr SizedKind kSizedKinds[] = {{"sphere", ShapeKind::sphere, 1},
                                     {"box", ShapeKind::box, 3},
                                     {"cylinder", ShapeKind::cylinder, 2},
                                     {"capsule", ShapeKind::capsule, 2},
                                     {"ellipsoid", ShapeKind::ellipsoid, 3}};

/// None: its numbers are missing or wrong.
Solid read_solid(Tag& tag, const SizedKind& of, const std::vector<double>& size) {
  bool good = size.size() >= of.sizes;
  for (std::size_t k = 0; good && k < of.sizes; ++k) good = size[k] > 0 && size[k] < kLargestLength;
  if (!good) {
    tag.wrong("size",
              fmt::format("must have {}, > 0, here",
                          of.sizes == 1 ? "a number" : fmt::format("{} numbers", of.sizes)));
    return {};
  }
  Shape shape;
  shape.kind = of.kind;
  if (of.sizes == 3)
    shape.size = (of.kind == ShapeKind::box ? 2 : 1) * Vector3d(size[0], size[1], size[2]);
  else
    shape.radius = size[0];
  if (of.sizes == 2) shape.length = 2 * size[1];
  return of_shape(shape);
}

/// Ends of the axis in place of size, position and orientation. As in MuJoCo the z axis of the geom
/// points from the second to the first of them, which turns the edges of boxes.
Isometry3d read_place(Tag& tag, const std::string& type, const Settings& settings,
                      std::vector<double>& size) {
  const std::vector<double> ends = tag.numbers("fromto", 6, 6);
  if (ends.empty()) {
    const Vector3d at = tag.vector("pos", Vector3d::Zero());
    return placed(settings.orientation(tag), at);
  }
  const Vector3d from(ends[0], ends[1], ends[2]), to(ends[3], ends[4], ends[5]);
  if (!((to - from).stableNorm() > 0)) tag.wrong("fromto", "must be two points");
  if (size.empty()) size.push_back(0);  // reported by read_solid()
  size.resize(1);
  if (type == "box" || type == "ellipsoid") size.push_back(size[0]);
  size.push_back((to - from).stableNorm() / 2);
  return placed(linalg::shortest_turn(Vector3d::UnitZ(), from - to), (from + to) / 2);
}

/// None: it touches nothing.
std::optional<Touch> read_touch(Tag& tag) {
  Touch out;
  const std::vector<double> friction = tag.numbers("friction", 1, 3);
  out.friction = friction.empty() ? 1 : friction[0];
  if (!(out.friction >= 0)) tag.wrong("friction", "must be >= 0");
  const double condim = tag.number("condim", 3);
  if (condim != 1 && condim != 3 && condim != 4 && condim != 6)
    tag.wrong("condim", "must be 1, 3, 4 or 6");
  out.tangential = condim > 1;
  for (const auto& [key, bits] :
       {std::pair("contype", &out.type), {"conaffinity", &out.affinity}}) {
    const double value = tag.number(key, 1);
    if (value >= 0 && value < 4294967296.0 && value == std::floor(value))
      *bits = static_cast<unsigned>(value);
    else
      tag.wrong(key, "must be a whole number of 32 bits");
  }
  return out.type != 0 || out.affinity != 0 ? std::optional(out) : std::nullopt;
}

}  // namespace

Matter read_geom(const Node& node, const std::string& class_name, const Settings& settings,
                 Problems& problems, Remarks& remarks) {
  Tag tag(node, problems, settings.defaults(node, class_name, problems));
  Matter out;
  out.name = tag.text("name");
  if (tag.has("name")) tag.name("name", "");
  const std::string type = tag.text("type", tag.has("mesh") ? "mesh" : "sphere");
  std::vector<double> size = tag.numbers("size", 1, 3);
  const Isometry3d place = read_place(tag, type, settings, size);
  out.touch = read_touch(tag);
  const double group = tag.number("group", 0), density = tag.not_negative("density", 1000);
  const bool weighs = group >= settings.least_group && group <= settings.most_group;

  Solid solid;
  const auto sized = std::find_if(std::begin(kSizedKinds), std::end(kSizedKinds),
                                  [&](const SizedKind& each) { return type == each.name; });
  if (sized != std::end(kSizedKinds)) {
    solid = read_solid(tag, *sized, size);
  } else if (type == "plane") {
    solid.shape.emplace().kind = ShapeKind::plane;
  } else if (type == "mesh" || type == "hfield" || type == "sdf") {
    if (type == "mesh")
      solid = read_mesh_solid(settings, tag.text("mesh"), name_or_line(node), out.touch.has_value(),
                              remarks);
    if (!solid.shape) remarks.add(fmt::format("geoms of type {}", type), name_or_line(node));
    const bool has_mass = !tag.has("mass") || tag.number("mass", 0) > 0;
    if (!(solid.volume > 0) && weighs && has_mass) out.mass = -1;
  } else {
    tag.wrong("type", "must be plane, sphere, capsule, cylinder, box, ellipsoid, mesh or hfield");
  }
  const double mass = tag.has("mass") ? tag.not_negative("mass", 0) : density * solid.volume;
  if (solid.volume > 0 && weighs) {
    out.mass = mass;
    const Matrix3d inertia = rotated(place.linear(), solid.inertia);
    out.inertia = mass / solid.volume / 2 * (inertia + inertia.transpose());
    out.centre = place * solid.centre;
  }
  if (solid.shape) {
    solid.shape->position = place.translation();
    if (place.linear() != Matrix3d::Identity()) solid.shape->orientation = place.linear();
    out.shapes.push_back(std::move(*solid.shape));
  }
  tag.finish(remarks, {"class", "rgba", "material", "user", "mesh", "hfield", "fitscale"});
  return out;
}

}  // namespace tether::scene::import::mjcf
