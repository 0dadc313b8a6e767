// Tether: which features of a scene may touch. SPDX-License-Identifier: BSD-3-Clause
//
// The engine has contacts whose gaps are smooth: spheres, capsules' ends and vertices against
// planes, spheres and points against spheres, capsules and the faces of boxes. Every vertex is a
// contact of its own.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <tether/scene/words.hpp>

#include "mechanics/placed_bodies.hpp"
#include "scene_model.hpp"

namespace tether::scene::event {

namespace {

/// More than these belong to stepping: every contact is looked at in every step.
constexpr std::size_t kMostContacts = 400;
constexpr long kMostMoving = 100;

/// A point of a body with a radius.
struct Knob {
  Vector3d at;
  double radius;
};

Vector3d placed(const Shape& shape, const Vector3d& local) {
  return shape.position + shape.orientation * local;
}

/// The points by which a shape touches a plane; a plane has none.
std::vector<Knob> knobs(const Shape& shape) {
  std::vector<Knob> out;
  switch (shape.kind) {
    case ShapeKind::sphere:
      out.push_back({shape.position, shape.radius});
      break;
    case ShapeKind::capsule:
      for (const double end : {-0.5, 0.5})
        out.push_back({placed(shape, {0, 0, end * shape.length}), shape.radius});
      break;
    case ShapeKind::box:
      for (int k = 0; k < 8; ++k)
        out.push_back(
            {placed(shape, 0.5 * Vector3d((k & 1) != 0 ? shape.size.x() : -shape.size.x(),
                                          (k & 2) != 0 ? shape.size.y() : -shape.size.y(),
                                          (k & 4) != 0 ? shape.size.z() : -shape.size.z())),
             0});
      break;
    case ShapeKind::convex:
    case ShapeKind::points:
      for (const Vector3d& p : shape.points) out.push_back({placed(shape, p), 0});
      break;
    case ShapeKind::plane:
      break;
  }
  return out;
}

PlaneFeature plane_of(const Shape& shape) {
  return {shape.position, shape.orientation * shape.normal, {}};
}

std::vector<PlaneFeature> faces_of_box(const Shape& shape) {
  std::vector<PlaneFeature> faces;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      PlaneFeature face;
      face.normal = shape.orientation * Vector3d(side * Vector3d::Unit(axis));
      face.at = placed(shape, 0.5 * side * shape.size[axis] * Vector3d::Unit(axis));
      for (int other = 0; other < 3; ++other) {
        if (other == axis) continue;
        for (const double way : {-1.0, 1.0}) {
          const Vector3d outward = shape.orientation * Vector3d(way * Vector3d::Unit(other));
          face.border.emplace_back(outward, outward.dot(shape.position) + 0.5 * shape.size[other]);
        }
      }
      faces.push_back(face);
    }
  return faces;
}

bool is_round(const Shape& shape) { return shape.kind == ShapeKind::sphere; }

/// Adds the contacts of a pair of shapes; false: their contact is not of the engine's kinds.
bool add(const Shape& a, const Shape& b, const FeaturePair& bodies, std::vector<FeaturePair>& out) {
  const auto put = [&](const Knob& knob, auto feature) {
    FeaturePair pair = bodies;
    pair.centre = knob.at;
    pair.radius = knob.radius;
    pair.on_second = std::move(feature);
    out.push_back(std::move(pair));
  };
  if (b.kind == ShapeKind::plane) {
    for (const Knob& knob : knobs(a)) put(knob, plane_of(b));
    return a.kind != ShapeKind::plane;
  }
  if (a.kind == ShapeKind::points && b.kind == ShapeKind::points) return true;  // never touch
  const bool has_points = is_round(a) || a.kind == ShapeKind::points;
  if (!has_points) return false;
  if (is_round(b)) {
    for (const Knob& knob : knobs(a)) put(knob, PointFeature{b.position, b.radius});
    return true;
  }
  if (b.kind == ShapeKind::box && a.kind == ShapeKind::points) {
    for (const Knob& knob : knobs(a))
      for (const PlaneFeature& face : faces_of_box(b)) put(knob, face);
    return true;
  }
  return false;
}

std::set<std::pair<int, int>> jointed(const Scene& scene) {
  std::set<std::pair<int, int>> pairs;
  for (const Joint& joint : scene.joints)
    if (joint.kind != JointKind::distance) pairs.insert(std::minmax(joint.first, joint.second));
  return pairs;
}

}  // namespace

std::vector<FeaturePair> potential_contacts(const Scene& scene) {
  const long moving = std::count_if(scene.bodies.begin(), scene.bodies.end(),
                                    [](const Body& body) { return !body.fixed; });
  if (moving > kMostMoving)
    throw std::invalid_argument(
        fmt::format("the event engine is for at most {} moving bodies, here are {}: use [stepping]",
                    kMostMoving, moving));
  std::map<std::pair<std::string, std::string>, const Pair*> meet;
  for (const Pair& pair : scene.pairs) meet[std::minmax(pair.first, pair.second)] = &pair;
  const std::set<std::pair<int, int>> apart = jointed(scene);
  std::vector<FeaturePair> out;
  const int count = static_cast<int>(scene.bodies.size());
  for (int i = 0; i < count; ++i)
    for (int j = i + 1; j < count; ++j) {
      const Body &a = scene.bodies[at(i)], &b = scene.bodies[at(j)];
      if ((a.fixed && b.fixed) || apart.count({i, j}) > 0) continue;
      const auto found = meet.find(std::minmax(a.material, b.material));
      if (found == meet.end()) continue;
      for (const Shape& s : a.shapes)
        for (const Shape& o : b.shapes) {
          FeaturePair pair;
          pair.friction = found->second->friction;
          pair.restitution = found->second->restitution;
          pair.first = i;
          pair.second = j;
          if (add(s, o, pair, out)) continue;
          std::swap(pair.first, pair.second);
          if (!add(o, s, pair, out))
            throw std::invalid_argument(fmt::format(
                "the event engine has no contact of {} with {} (bodies \"{}\" and \"{}\"): use "
                "[stepping]",
                word(s.kind), word(o.kind), a.name, b.name));
        }
      if (out.size() > kMostContacts)
        throw std::invalid_argument(fmt::format(
            "the event engine looks at every potential contact in every step; here are more than "
            "{}: use [stepping]",
            kMostContacts));
    }
  return out;
}

}  // namespace tether::scene::event

namespace tether::scene {

std::string event_engine_refusal(const Scene& scene) {
  for (const Invariant& each : scene.invariants)
    if (each.project)
      return "the event engine keeps energy less work and losses by itself and projects no other "
             "invariants: give them project = false";
  try {
    event::potential_contacts(scene);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return {};
}

}  // namespace tether::scene
