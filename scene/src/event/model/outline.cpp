// Tether: the features by which a shape touches others. SPDX-License-Identifier: BSD-3-Clause
#include "outline.hpp"

#include <set>
#include <tether/linalg/convex_hull.hpp>

#include "mechanics/bodies.hpp"
#include "scene_model.hpp"

namespace tether::scene::event {

namespace {

Vector3d placed(const Shape& shape, const Vector3d& local) {
  return shape.position + shape.orientation * local;
}

std::vector<Vector3d> corners_of_box(const Vector3d& size) {
  std::vector<Vector3d> out;
  for (int k = 0; k < 8; ++k)
    out.emplace_back(0.5 * ((k & 1) != 0 ? size.x() : -size.x()),
                     0.5 * ((k & 2) != 0 ? size.y() : -size.y()),
                     0.5 * ((k & 4) != 0 ? size.z() : -size.z()));
  return out;
}

/// A face between corners that are counter-clockwise from outside.
PlaneFeature face_between(const std::vector<Vector3d>& corners) {
  PlaneFeature face;
  Vector3d area = Vector3d::Zero();
  for (std::size_t k = 1; k + 1 < corners.size(); ++k)
    area += (corners[k] - corners[0]).cross(corners[k + 1] - corners[0]);
  face.normal = area.normalized();
  face.at = corners[0];
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const Vector3d along = corners[(k + 1) % corners.size()] - corners[k];
    const Vector3d outward = along.cross(face.normal).normalized();
    face.border.emplace_back(outward, outward.dot(corners[k]));
  }
  return face;
}

void add_polyhedron(const std::vector<Vector3d>& points, Outline& out) {
  const std::size_t first_knob = out.knobs.size() - points.size();
  std::map<std::pair<std::size_t, std::size_t>, Segment> edges;
  for (const std::vector<std::size_t>& face : linalg::hull_faces(points)) {
    std::vector<Vector3d> corners;
    for (const std::size_t k : face) corners.push_back(points[k]);
    out.faces.push_back(face_between(corners));
    for (std::size_t k = 0; k < face.size(); ++k) {
      const std::pair<std::size_t, std::size_t> ends =
          std::minmax(face[k], face[(k + 1) % face.size()]);
      const bool known = edges.count(ends) > 0;
      Segment& edge = edges[ends];
      edge.at = points[ends.first];
      const Vector3d way = points[ends.second] - points[ends.first];
      edge.length = way.norm();
      edge.along = way / edge.length;
      edge.inward[known ? 1 : 0] = -out.faces.back().border[k].first;
    }
  }
  for (const auto& [ends, edge] : edges) {
    out.segments.push_back(edge);
    const Vector3d way = edge.length * edge.along;
    out.knobs[first_knob + ends.first].edges.push_back(way);
    out.knobs[first_knob + ends.second].edges.push_back(-way);
  }
}

Segment axis_of(const Shape& shape) {
  Segment axis;
  axis.at = placed(shape, {0, 0, -0.5 * shape.length});
  axis.along = shape.orientation * Vector3d(0, 0, 1);
  axis.length = shape.length;
  axis.radius = shape.radius;
  return axis;
}

void add_cylinder(const Shape& shape, Outline& out) {
  out.segments.push_back(axis_of(shape));
  for (const double side : {-1.0, 1.0}) {
    Round disc;
    disc.at = placed(shape, {0, 0, 0.5 * side * shape.length});
    disc.shape =
        shape.orientation.toRotationMatrix() * Vector3d(shape.radius, shape.radius, 0).asDiagonal();
    disc.outward = shape.orientation * Vector3d(0, 0, side);
    out.rounds.push_back(disc);
    out.ends.push_back({{disc.at, disc.outward, {}}, shape.radius});
  }
}

/// More than these belong to stepping: every contact is looked at in every step.
constexpr std::size_t kMostContacts = 16000;
constexpr long kMostMoving = 100;

PlaneFeature plane_of(const Shape& shape) {
  return {shape.position, shape.orientation * shape.normal, {}};
}

/// The contacts of a pair of shapes, one after the other.
class Contacts {
 public:
  Contacts(const FeaturePair& bodies, std::vector<FeaturePair>& out) : bodies_(bodies), out_(out) {}
  Contacts swapped() const {
    Contacts other(*this);
    std::swap(other.bodies_.first, other.bodies_.second);
    return other;
  }

  template <class Feature>
  void put(const Knob& knob, Feature feature) {
    out_.push_back(bodies_);
    out_.back().centre = knob.at;
    out_.back().radius = knob.radius;
    out_.back().edges = knob.edges;
    out_.back().on_second.emplace<Feature>(std::move(feature));
  }

  template <class Feature>
  void put(Feature feature) {
    put(Knob{}, std::move(feature));
  }

  /// Points of the first on faces and lines of the second. Sharp points and edges meet by chance
  /// only.
  void put_points(const Outline& a, const Outline& b) {
    for (const Knob& knob : a.knobs) {
      for (const PlaneFeature& face : b.faces) put(knob, face);
      for (const Segment& s : b.segments)
        if (knob.radius + s.radius > 0) put(knob, LineFeature{s.at, s.along, s.length, s.radius});
    }
  }
  void put_on_plane(const Outline& a, const PlaneFeature& plane) {
    for (const Knob& knob : a.knobs) put(knob, plane);
    for (const Round& round : a.rounds) put(RoundOnPlane{round, plane, 0});
  }

  /// Pairs of the round features of the first with all features of the second but round ones.
  void put_rounds(const Outline& a, const Outline& b) {
    for (const Round& round : a.rounds) {
      for (const PlaneFeature& face : b.faces) put(RoundOnPlane{round, face, 0});
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
          put(knob, PointOnCircle{end.plane.at, end.plane.normal, end.radius});
    }
  }
  void put_rounds_on_each_other(const Outline& a, const Outline& b) {
    for (const Round& round : a.rounds)
      for (const Round& other : b.rounds) put(RoundOnRound{round, other});
  }
  void put_points_and_edges(const Outline& a, const Outline& b) {
    for (const Knob& knob : a.knobs)
      for (const Knob& other : b.knobs)
        if (knob.radius + other.radius > 0) put(knob, PointFeature{other.at, other.radius});
    // The sign of a normal is that of a sharp edge.
    for (const Segment& s : a.segments)
      for (const Segment& o : b.segments) {
        if (s.is_sharp() && !o.is_sharp())
          swapped().put(Knob{}, CrossingFeature{o, s});
        else
          put(Knob{}, CrossingFeature{s, o});
      }
  }

 private:
  FeaturePair bodies_;
  std::vector<FeaturePair>& out_;
};

void refuse_unknown(const Shape& shape) {
  if (shape.kind == ShapeKind::mesh)
    throw std::invalid_argument(
        fmt::format("the event engine does not know where a shape = \"{}\" touches: use [stepping]",
                    name(shape.kind)));
}

void add(const Shape& a, const Shape& b, const FeaturePair& bodies, std::vector<FeaturePair>& out) {
  refuse_unknown(a);
  refuse_unknown(b);
  const bool points = a.kind == ShapeKind::points && b.kind == ShapeKind::points;
  if (points || (a.kind == ShapeKind::plane && b.kind == ShapeKind::plane)) return;  // never touch
  const Outline of_a = outline_of(a), of_b = outline_of(b);
  Contacts contacts(bodies, out), swapped = contacts.swapped();
  if (b.kind == ShapeKind::plane) return contacts.put_on_plane(of_a, plane_of(b));
  if (a.kind == ShapeKind::plane) return swapped.put_on_plane(of_b, plane_of(a));
  contacts.put_points(of_a, of_b);
  swapped.put_points(of_b, of_a);
  contacts.put_points_and_edges(of_a, of_b);
  contacts.put_rounds(of_a, of_b);
  swapped.put_rounds(of_b, of_a);
  contacts.put_rounds_on_each_other(of_a, of_b);
}

std::set<std::pair<int, int>> jointed(const Scene& scene) {
  std::set<std::pair<int, int>> pairs;
  for (const Joint& joint : scene.joints)
    if (joint.kind != JointKind::distance) pairs.insert(std::minmax(joint.first, joint.second));
  return pairs;
}

}  // namespace

Outline outline_of(const Shape& shape) {
  Outline out;
  std::vector<Vector3d> points;
  switch (shape.kind) {
    case ShapeKind::sphere:
      out.knobs.push_back({shape.position, shape.radius, {}});
      break;
    case ShapeKind::capsule:
      for (const double end : {-0.5, 0.5})
        out.knobs.push_back({placed(shape, {0, 0, end * shape.length}), shape.radius, {}});
      out.segments.push_back(axis_of(shape));
      break;
    case ShapeKind::box:
      points = corners_of_box(shape.size);
      break;
    case ShapeKind::convex:
    case ShapeKind::points:
      points = shape.points;
      break;
    case ShapeKind::ellipsoid: {
      Round round;
      round.at = shape.position;
      round.shape = shape.orientation.toRotationMatrix() * shape.size.asDiagonal();
      out.rounds.push_back(round);
      break;
    }
    case ShapeKind::cylinder:
      add_cylinder(shape, out);
      break;
    case ShapeKind::plane:
    case ShapeKind::mesh:  // refused before
      break;
  }
  for (Vector3d& p : points) {
    p = placed(shape, p);
    out.knobs.push_back({p, 0, {}});
  }
  if (shape.kind == ShapeKind::box || shape.kind == ShapeKind::convex) add_polyhedron(points, out);
  return out;
}

double reach_of(const Shape& shape) {
  if (shape.kind == ShapeKind::plane) return kNoBorder;
  const Outline outline = outline_of(shape);
  double far = 0;
  for (const Knob& each : outline.knobs) far = std::max(far, each.at.norm() + each.radius);
  for (const Round& each : outline.rounds) far = std::max(far, each.at.norm() + each.size());
  for (const End& each : outline.ends) far = std::max(far, each.plane.at.norm() + each.radius);
  for (const Segment& s : outline.segments)
    far = std::max({far, s.at.norm() + s.radius, (s.at + s.length * s.along).norm() + s.radius});
  return far;
}

// The engine has contacts whose gaps are smooth: points (vertices, centres of spheres, ends of
// capsules) and round things (ellipsoids, discs of cylinders) with planes, faces, lines, points and
// each other, and lines (edges, axes of capsules and cylinders) with lines. Every such pair is a
// contact of its own.

std::vector<FeaturePair> potential_contacts(const Scene& scene) {
  const long moving = std::count_if(scene.bodies.begin(), scene.bodies.end(),
                                    [](const Body& body) { return !body.fixed; });
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
          pair.rolling = found->second->rolling;
          pair.torsional = found->second->torsional;
          pair.reach = reach_of(s) + reach_of(o);
          pair.first = i;
          pair.second = j;
          add(s, o, pair, out);
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
