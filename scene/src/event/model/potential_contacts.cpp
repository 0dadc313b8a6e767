// Tether: pairs of features that may touch. SPDX-License-Identifier: BSD-3-Clause

#include <set>

#include "geometry/shape_type.hpp"
#include "mechanics/force.hpp"
#include "model.hpp"

namespace tether::scene::event {

namespace {

/// More than these belong to stepping: every contact is evaluated in every step.
constexpr std::size_t kMostContacts = 16000;
constexpr std::size_t kMostMoving = 100;

/// The contacts of a pair of shapes, one after the other.
class Contacts {
 public:
  Contacts(const FeaturePair& bodies, std::vector<FeaturePair>& out) : bodies_(bodies), out_(out) {}
  Contacts swapped() const {
    Contacts other(*this);
    std::swap(other.bodies_.first, other.bodies_.second);
    return other;
  }

  template <class Features>
  void put(Features features) {
    out_.push_back(bodies_);
    out_.back().features = std::move(features);
  }

  /// Points of the first on faces and lines of the second. Sharp points and edges meet by chance
  /// only.
  void put_points(const Outline& a, const Outline& b) {
    for (const Knob& knob : a.knobs) {
      for (const Face& face : b.faces) put(PointOnPlane{knob, face});
      for (const Segment& s : b.segments)
        if (knob.radius + s.radius > 0) put(PointOnLine{knob, s});
    }
  }
  void put_on_plane(const Outline& a, const Face& plane) {
    for (const Knob& knob : a.knobs) put(PointOnPlane{knob, plane});
    for (const Round& round : a.rounds) put(RoundOnPlane{round, plane, 0});
  }

  /// Pairs of the round features of the first with all features of the second but round ones.
  void put_rounds(const Outline& a, const Outline& b) {
    for (const Round& round : a.rounds) {
      for (const Face& face : b.faces) put(RoundOnPlane{round, face, 0});
      for (const End& end : b.ends) put(RoundOnPlane{round, end.plane, end.radius});
      for (const Segment& s : b.segments) put(RoundOnLine{round, s});
    }
    for (const Knob& knob : a.knobs) {
      const Round point{knob.at, Matrix3d::Zero(), knob.radius, Vector3d::Zero()};
      for (const End& end : b.ends) put(RoundOnPlane{point, end.plane, end.radius});
      for (const Round& round : b.rounds)
        if (!round.is_disc()) put(RoundOnRound{point, round});
      if (knob.radius > 0)
        for (const End& end : b.ends)
          put(PointOnCircle{knob, end.plane.at, end.plane.normal, end.radius});
    }
  }
  void put_rounds_on_each_other(const Outline& a, const Outline& b) {
    for (const Round& round : a.rounds)
      for (const Round& other : b.rounds) put(RoundOnRound{round, other});
  }
  void put_points_and_edges(const Outline& a, const Outline& b) {
    for (const Knob& knob : a.knobs)
      for (const Knob& other : b.knobs)
        if (knob.radius + other.radius > 0) put(PointOnPoint{knob, other.at, other.radius});
    // The sign of a normal is that of a sharp edge.
    for (const Segment& s : a.segments)
      for (const Segment& o : b.segments) {
        if (s.is_sharp() && !o.is_sharp())
          swapped().put(CrossingFeature{o, s});
        else
          put(CrossingFeature{s, o});
      }
  }

 private:
  FeaturePair bodies_;
  std::vector<FeaturePair>& out_;
};

Outline outline_of(const Shape& shape) {
  Outline out;
  if (!type_of(shape.kind).add_outline(shape, out))
    throw std::invalid_argument(
        fmt::format("the event engine does not know where a shape = \"{}\" touches: use [stepping]",
                    name(shape.kind)));
  return out;
}

void add(const Shape& a, const Outline& of_a, const Shape& b, const Outline& of_b,
         const FeaturePair& of_bodies, std::vector<FeaturePair>& out) {
  const bool points = a.kind == ShapeKind::points && b.kind == ShapeKind::points;
  const bool on_plane = b.kind == ShapeKind::plane;
  if (points || (a.kind == ShapeKind::plane && on_plane)) return;  // never touch
  FeaturePair bodies = of_bodies;
  if (a.kind != ShapeKind::plane && !on_plane) bodies.reach = of_a.reach() + of_b.reach();
  Contacts contacts(bodies, out), swapped = contacts.swapped();
  if (on_plane) return contacts.put_on_plane(of_a, of_b.faces[0]);
  if (a.kind == ShapeKind::plane) return swapped.put_on_plane(of_b, of_a.faces[0]);
  contacts.put_points(of_a, of_b);
  swapped.put_points(of_b, of_a);
  contacts.put_points_and_edges(of_a, of_b);
  contacts.put_rounds(of_a, of_b);
  swapped.put_rounds(of_b, of_a);
  contacts.put_rounds_on_each_other(of_a, of_b);
}

// One outline a shape; that of parts which lie against each other is that of the first.
std::vector<Outline> outlines_of(const Body& body) {
  std::vector<Outline> out;
  for (const Shape& shape : body.shapes) out.push_back(outline_of(shape));
  if (out.size() > 1) join_outlines(contact::open_faces(body.shapes), out);
  return out;
}

std::set<std::pair<int, int>> jointed(const Scene& scene) {
  std::set<std::pair<int, int>> pairs;
  for (const Joint& joint : scene.joints)
    if (joint.kind != JointKind::distance) pairs.insert(std::minmax(joint.first, joint.second));
  return pairs;
}

void put_friction(const Scene& scene, const Pair& from, FeaturePair& pair) {
  pair.friction = from.friction;
  if (!from.is_elliptic()) return;
  pair.friction = std::max(from.friction, *from.friction_across);
  const bool first = scene.bodies[at(pair.first)].material == from.first;
  const int with_axis = first ? pair.first : pair.second;
  const Body& body = scene.bodies[at(with_axis)];
  if (!body.friction_axis)
    throw std::invalid_argument("body \"" + body.name +
                                "\": its material has elliptic friction, so that it needs a "
                                "friction_axis");
  pair.elliptic =
      EllipticFriction{with_axis, body.friction_axis->normalized(), from.friction / pair.friction,
                       *from.friction_across / pair.friction};
}

}  // namespace

// The engine has contacts whose gaps are smooth: points (vertices, centres of spheres, ends of
// capsules) and round things (ellipsoids, discs of cylinders) with planes, faces, lines, points and
// each other, and lines (edges, axes of capsules and cylinders) with lines. Every such pair is a
// contact of its own.

std::vector<FeaturePair> potential_contacts(const Scene& scene) {
  const std::size_t moving = scene.moving().size();
  if (moving > kMostMoving)
    throw std::invalid_argument(
        fmt::format("the event engine is for at most {} moving bodies, here are {}: use [stepping]",
                    kMostMoving, moving));
  std::map<std::pair<std::string, std::string>, const Pair*> meet;
  for (const Pair& pair : scene.pairs)
    if (pair.touch) meet[std::minmax(pair.first, pair.second)] = &pair;
  const std::set<std::pair<int, int>> apart = jointed(scene);
  std::vector<FeaturePair> out;
  const int count = static_cast<int>(scene.bodies.size());
  std::vector<std::vector<Outline>> outlines(scene.bodies.size());
  const auto shapes_of = [&](int b) -> const std::vector<Outline>& {
    if (outlines[at(b)].empty()) outlines[at(b)] = outlines_of(scene.bodies[at(b)]);
    return outlines[at(b)];
  };
  for (int i = 0; i < count; ++i)
    for (int j = i + 1; j < count; ++j) {
      const Body &a = scene.bodies[at(i)], &b = scene.bodies[at(j)];
      if ((a.fixed && b.fixed) || apart.count({i, j}) > 0) continue;
      const auto found = meet.find(std::minmax(a.material, b.material));
      if (found == meet.end()) continue;
      const std::vector<Outline>&of_a = shapes_of(i), &of_b = shapes_of(j);
      for (std::size_t s = 0; s < a.shapes.size(); ++s)
        for (std::size_t o = 0; o < b.shapes.size(); ++o) {
          FeaturePair pair;
          pair.restitution = found->second->restitution;
          pair.rolling = found->second->rolling;
          pair.torsional = found->second->torsional;
          pair.first = i;
          pair.second = j;
          put_friction(scene, *found->second, pair);
          add(a.shapes[s], of_a[s], b.shapes[o], of_b[o], pair, out);
        }
      if (out.size() > kMostContacts)
        throw std::invalid_argument(fmt::format(
            "the event engine checks every potential contact in every step; here are more than "
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
