// Tether: a scene as bodies, surfaces and meetings of the contact library.
// SPDX-License-Identifier: BSD-3-Clause
#include "map_scene.hpp"

#include <map>
#include <stdexcept>
#include <string>

#include "effects/list.hpp"

namespace tether::scene::stepping {

namespace {

contact::ShapeKind kind(ShapeKind k) {
  switch (k) {
    case ShapeKind::sphere:
      return contact::ShapeKind::sphere;
    case ShapeKind::plane:
      return contact::ShapeKind::plane;
    case ShapeKind::box:
      return contact::ShapeKind::box;
    case ShapeKind::capsule:
      return contact::ShapeKind::capsule;
    case ShapeKind::convex:
      return contact::ShapeKind::convex;
    case ShapeKind::points:
      return contact::ShapeKind::points;
  }
  throw std::invalid_argument("unknown kind of shape");
}

void refuse(const Scene& scene) {
  for (const Invariant& each : scene.invariants)
    if (each.project)
      throw std::invalid_argument(
          "the stepping engine projects no invariants: give them project = false, or, without "
          "contacts, use the smooth engine");
}

// Materials that no pair names get none, so that their bodies have no surfaces at all.
std::map<std::string, int> materials(const Scene& scene) {
  std::map<std::string, int> index;
  for (const Pair& pair : scene.pairs) {
    index.emplace(pair.first, static_cast<int>(index.size()));
    index.emplace(pair.second, static_cast<int>(index.size()));
  }
  return index;
}

}  // namespace

Mapped map_scene(const Scene& scene) {
  refuse(scene);
  Mapped out;
  const std::map<std::string, int> material = materials(scene);
  for (const Body& body : scene.bodies) {
    const std::string where = "body \"" + body.name + "\": ";
    int index = 0;
    try {
      index = body.fixed ? out.bodies.add_fixed(body.position, body.orientation)
                         : out.bodies.add(body.mass, body.inertia, body.position, body.orientation,
                                          body.velocity, body.angular_velocity);
    } catch (const std::invalid_argument& problem) {
      throw std::invalid_argument(where + problem.what());
    }
    const auto found = material.find(body.material);
    if (found == material.end()) continue;
    for (const Shape& shape : body.shapes) {
      contact::Surface surface;
      surface.body = index;
      surface.material = found->second;
      surface.shape.kind = kind(shape.kind);
      surface.shape.radius = shape.radius;
      surface.shape.length = shape.length;
      surface.shape.size = shape.size;
      surface.shape.normal = shape.normal;
      surface.shape.points = shape.points;
      surface.shape.position = shape.position;
      surface.shape.orientation = shape.orientation;
      out.surfaces.push_back(std::move(surface));
    }
  }
  for (const Pair& pair : scene.pairs) {
    contact::Meeting meeting;
    meeting.first = material.at(pair.first);
    meeting.second = material.at(pair.second);
    for (const effects::Effect* each : effects::all()) each->configure_pair(pair, meeting);
    out.meetings.push_back(meeting);
  }

  const SteppingOptions options = scene.stepping.value_or(SteppingOptions{});
  out.options.step = options.step;
  out.options.tolerance = options.tolerance;
  out.options.error_reduction = options.error_reduction;
  out.options.max_depenetration_speed = options.max_depenetration_speed;
  out.options.acceptance = options.acceptance;
  out.options.max_halvings = options.max_halvings;
  out.options.threads = options.threads;
  for (const effects::Effect* each : effects::all()) {
    each->configure(scene, out.options);
    if (!scene.pairs.empty()) each->configure_contact(scene, out.options);
  }
  return out;
}

}  // namespace tether::scene::stepping
