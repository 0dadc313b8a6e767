// Tether: what scenes know of one kind of shape. SPDX-License-Identifier: BSD-3-Clause
#include "shape_type.hpp"

#include <cmath>
#include <numeric>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/pi.hpp>

#include "bounds.hpp"

namespace tether::scene {

using Eigen::Vector3d;

#define SHAPE(kind) const ShapeType& kind##_type();
#include "shape_type_list.inc"
#undef SHAPE

#define SHAPE(kind) +1
static_assert(0
#include "shape_type_list.inc"
                  == contact::kShapeKinds.size(),
              "each kind has a file in the folder shapes");
#undef SHAPE

namespace {

/// A face between corners that are counter-clockwise from outside.
Face face_between(const std::vector<Vector3d>& corners) {
  Face face;
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

}  // namespace

const ShapeType& type_of(ShapeKind kind) {
  switch (kind) {
#define SHAPE(each)     \
  case ShapeKind::each: \
    return each##_type();
#include "shape_type_list.inc"
#undef SHAPE
  }
  throw std::logic_error("a shape of no kind");
}

void ShapeType::read(files::Fields& in, files::Reader&, Shape& shape) const {
  for (const ShapeField& field : fields()) {
    if (field.meaning != nullptr && !in.has(field.key)) in.missing(field.key, field.meaning);
    if (const auto* number = std::get_if<double Shape::*>(&field.value))
      shape.** number = in.number(field.key, 1, files::kPositive, field.unit);
    else if (const auto* points = std::get_if<std::vector<Vector3d> Shape::*>(&field.value))
      shape.** points = in.points(field.key, field.least, kMostPoints);
    else if (const auto* vector = std::get_if<Vector3d Shape::*>(&field.value))
      shape.** vector = field.meaning == nullptr
                            ? in.direction(field.key, Vector3d::UnitZ())
                            : in.vector(field.key, Vector3d::Ones(), files::kPositive, field.unit);
  }
}

double Outline::reach() const {
  double far = 0;
  for (const Knob& each : knobs) far = std::max(far, each.at.norm() + each.radius);
  for (const Round& each : rounds) far = std::max(far, each.at.norm() + each.size());
  for (const End& each : ends) far = std::max(far, each.plane.at.norm() + each.radius);
  for (const Segment& s : segments)
    far = std::max({far, s.at.norm() + s.radius, (s.at + s.length * s.along).norm() + s.radius});
  return far;
}

void add_axis(const Shape& shape, Outline& out) {
  Segment axis;
  axis.at = placed(shape, {0, 0, -0.5 * shape.length});
  axis.along = shape.orientation * Vector3d(0, 0, 1);
  axis.length = shape.length;
  axis.radius = shape.radius;
  out.segments.push_back(axis);
}

void add_corners(const Shape& shape, const std::vector<Vector3d>& local, bool solid, Outline& out) {
  std::vector<Vector3d> points;
  for (const Vector3d& p : local) {
    points.push_back(placed(shape, p));
    out.knobs.push_back({points.back(), 0, {}});
  }
  if (solid) add_polyhedron(points, out);
}

namespace {

// Points nearer than this part of the extent of a body are one, as for the seams of contact.
constexpr double kSamePoint = 1e-6;

// Adds the part of an edge of face `a` along which face b goes down from it.
void add_shared_edge(const contact::OpenFace& a, std::size_t i, const contact::OpenFace& b,
                     double same, Outline& out) {
  const Vector3d& from = a.corners[i];
  const Vector3d way = a.corners[(i + 1) % a.corners.size()] - from;
  Segment edge;
  edge.along = way.normalized();
  for (std::size_t k = 0; k < b.corners.size(); ++k) {
    const Vector3d p = b.corners[(k + 1) % b.corners.size()] - from, q = b.corners[k] - from;
    const double start = std::max(0.0, edge.along.dot(p));
    const double end = std::min(way.norm(), edge.along.dot(q));
    if (end - start <= same || p.cross(edge.along).norm() > same ||
        q.cross(edge.along).norm() > same)
      continue;
    edge.inward = {a.normal.cross(edge.along), edge.along.cross(b.normal)};
    if (!(a.normal.dot(edge.inward[1]) < -kSamePoint)) continue;  // flat or hollow
    edge.at = from + start * edge.along;
    edge.length = end - start;
    out.segments.push_back(edge);
  }
}

// The ends of edges, but for those between two edges of one line.
void add_knobs(double same, Outline& out) {
  const auto end_at = [&](const Vector3d& at, const Vector3d& way) {
    const auto known = std::find_if(out.knobs.begin(), out.knobs.end(),
                                    [&](const Knob& k) { return (k.at - at).norm() <= same; });
    if (known == out.knobs.end())
      out.knobs.push_back({at, 0, {way}});
    else
      known->edges.push_back(way);
  };
  for (const Segment& s : out.segments) {
    const Vector3d way = s.length * s.along;
    end_at(s.at, way);
    end_at(s.at + way, -way);
  }
  const auto is_straight = [](const Knob& k) {
    return std::all_of(k.edges.begin(), k.edges.end(), [&](const Vector3d& way) {
      return way.normalized().cross(k.edges[0].normalized()).norm() <= kSamePoint;
    });
  };
  out.knobs.erase(std::remove_if(out.knobs.begin(), out.knobs.end(), is_straight), out.knobs.end());
}

}  // namespace

void join_outlines(const std::vector<std::vector<contact::OpenFace>>& faces,
                   std::vector<Outline>& outlines) {
  std::vector<const contact::OpenFace*> all;
  Outline joined;
  Outline* first = nullptr;
  double size = 0;
  for (std::size_t k = 0; k < faces.size(); ++k) {
    if (faces[k].empty()) continue;
    if (first == nullptr) first = &outlines[k];
    size = std::max(size, outlines[k].reach());
    outlines[k] = Outline();
    for (const contact::OpenFace& each : faces[k]) {
      all.push_back(&each);
      joined.faces.push_back(face_between(each.corners));
    }
  }
  if (first == nullptr) return;
  const double same = kSamePoint * size;
  for (std::size_t a = 0; a < all.size(); ++a)
    for (std::size_t b = a + 1; b < all.size(); ++b)
      for (std::size_t i = 0; i < all[a]->corners.size(); ++i)
        add_shared_edge(*all[a], i, *all[b], same, joined);
  add_knobs(same, joined);
  *first = std::move(joined);
}

Mesh capsule_mesh(double radius, double length, int around) {
  const int rings = std::max(2, around / 4);  // of each half, pole excluded
  const auto n = static_cast<std::size_t>(around);
  Mesh m;
  m.points.emplace_back(0, 0, -length / 2 - radius);
  for (int ring = 0; ring < 2 * rings; ++ring) {
    const bool upper = ring >= rings;
    const double latitude = upper ? linalg::kPi / 2 * (ring - rings) / rings
                                  : linalg::kPi / 2 * (ring + 1 - rings) / rings;
    for (int k = 0; k < around; ++k) {
      const double longitude = 2 * linalg::kPi * k / around;
      m.points.emplace_back(radius * std::cos(latitude) * std::cos(longitude),
                            radius * std::cos(latitude) * std::sin(longitude),
                            radius * std::sin(latitude) + (upper ? length / 2 : -length / 2));
    }
  }
  m.points.emplace_back(0, 0, length / 2 + radius);
  const std::size_t last = m.points.size() - 1;
  const auto at = [&](int ring, std::size_t k) {
    return 1 + static_cast<std::size_t>(ring) * n + k % n;
  };
  for (std::size_t k = 0; k < n; ++k) {
    m.faces.push_back({0, at(0, k + 1), at(0, k)});
    for (int ring = 0; ring + 1 < 2 * rings; ++ring) {
      if (ring + 1 == rings && length == 0) continue;  // both are the equator
      m.faces.push_back({at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)});
    }
    m.faces.push_back({last, at(2 * rings - 1, k), at(2 * rings - 1, k + 1)});
  }
  return m;
}

Mesh points_mesh(const std::vector<Vector3d>& all) {
  Mesh m{all, linalg::hull_faces(all), {}};
  if (!m.faces.empty()) return m;
  m.single.resize(all.size());
  std::iota(m.single.begin(), m.single.end(), std::size_t{0});
  return m;
}

Mesh mesh(const Shape& shape, int around, double half_plane) {
  Mesh m = type_of(shape.kind).polygons(shape, around, half_plane);
  for (Vector3d& p : m.points) p = shape.position + shape.orientation * p;
  return m;
}

double reach_of(const Body& body) {
  double reach = 0;
  for (const Shape& shape : body.shapes) {
    if (shape.kind == ShapeKind::plane) return kInfinity;
    for (const Vector3d& p : mesh(shape, 8, 0).points) reach = std::max(reach, p.norm());
  }
  return reach;
}

}  // namespace tether::scene
