// Tether: the features by which a shape touches others. SPDX-License-Identifier: BSD-3-Clause
#include "outline.hpp"

#include <Eigen/Geometry>
#include <map>
#include <tether/linalg/convex_hull.hpp>

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

}  // namespace tether::scene::event
