// Tether: convex polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include "collision/polyhedron.hpp"

#include <LinearMath/btConvexHullComputer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// Newell's normal of a closed loop: twice its area long.
Vector3d newell(const std::vector<Vector3d>& vertices, const std::vector<int>& loop) {
  Vector3d sum = Vector3d::Zero();
  const Vector3d& origin = vertices[at(loop[0])];
  for (std::size_t k = 1; k + 1 < loop.size(); ++k)
    sum += (vertices[at(loop[k])] - origin).cross(vertices[at(loop[k + 1])] - origin);
  return sum;
}

void finish(Polyhedron& p) {
  std::map<std::pair<int, int>, int> left;  // face on the left of a directed edge
  p.size = std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < p.faces.size(); ++f) {
    Polyhedron::Face& face = p.faces[f];
    face.normal = newell(p.vertices, face.loop).normalized();
    face.offset = 0;
    for (const int v : face.loop) face.offset += face.normal.dot(p.vertices[at(v)]);
    face.offset /= static_cast<double>(face.loop.size());
    double width = 0;
    for (const Vector3d& v : p.vertices) width = std::max(width, face.offset - face.normal.dot(v));
    p.size = std::min(p.size, width);
    for (std::size_t k = 0; k < face.loop.size(); ++k)
      left[{face.loop[k], face.loop[(k + 1) % face.loop.size()]}] = static_cast<int>(f);
  }
  for (const auto& [edge, face] : left) {
    const auto other = left.find({edge.second, edge.first});
    if (other == left.end()) throw std::invalid_argument("convex: the points have no closed hull");
    if (edge.first < edge.second) p.edges.push_back({edge.first, edge.second, face, other->second});
  }
}

Polyhedron box(const Vector3d& size) {
  Polyhedron p;
  for (int k = 0; k < 8; ++k)
    p.vertices.push_back(
        Vector3d((k & 1) != 0 ? 0.5 : -0.5, (k & 2) != 0 ? 0.5 : -0.5, (k & 4) != 0 ? 0.5 : -0.5)
            .cwiseProduct(size));
  const int loops[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                           {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& loop : loops) {
    Polyhedron::Face face;
    face.loop.assign(loop, loop + 4);
    p.faces.push_back(face);
  }
  finish(p);
  return p;
}

// Bullet's hull works on a grid of integers: only which points span it is taken from there. Faces
// are put together from its triangles with the points as given, largest triangles first.
Polyhedron hull(const std::vector<Vector3d>& points) {
  const auto flat = [] { return std::invalid_argument("convex: the points lie in a plane"); };
  btConvexHullComputer computer;
  computer.compute(points[0].data(), sizeof(Vector3d), static_cast<int>(points.size()), 0, 0);

  Polyhedron p;
  for (int k = 0; k < computer.vertices.size(); ++k)
    p.vertices.push_back(points[at(computer.original_vertex_index[k])]);
  Vector3d low = p.vertices[0], high = low;
  for (const Vector3d& v : p.vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  const double extent = (high - low).norm(), thin = 1e-7 * extent;

  struct Triangle {
    int a, b, c;
    Vector3d twice_area;
  };
  std::vector<Triangle> triangles;
  for (int f = 0; f < computer.faces.size(); ++f) {
    const btConvexHullComputer::Edge* first = &computer.edges[computer.faces[f]];
    const btConvexHullComputer::Edge* e = first->getNextEdgeOfFace();
    for (; e->getTargetVertex() != first->getSourceVertex(); e = e->getNextEdgeOfFace()) {
      const int a = first->getSourceVertex(), b = e->getSourceVertex(), c = e->getTargetVertex();
      triangles.push_back({a, b, c, newell(p.vertices, {a, b, c})});
    }
  }
  Vector3d centre = Vector3d::Zero();
  for (const Vector3d& v : p.vertices) centre += v / static_cast<double>(p.vertices.size());
  std::sort(triangles.begin(), triangles.end(), [](const Triangle& s, const Triangle& t) {
    return s.twice_area.squaredNorm() > t.twice_area.squaredNorm();
  });
  for (const Triangle& t : triangles) {
    if (!(t.twice_area.norm() > thin * thin)) continue;
    Vector3d n = t.twice_area.normalized();
    double offset = n.dot(p.vertices[at(t.a)]);
    if (n.dot(centre) > offset) {
      n = -n;
      offset = -offset;
    }
    const bool known = std::any_of(p.faces.begin(), p.faces.end(), [&](const Polyhedron::Face& f) {
      const auto has = [&](int v) {
        return std::find(f.loop.begin(), f.loop.end(), v) != f.loop.end();
      };
      return has(t.a) && has(t.b) && has(t.c);
    });
    if (known) continue;
    Polyhedron::Face face;
    for (int v = 0; v < static_cast<int>(p.vertices.size()); ++v)
      if (std::abs(n.dot(p.vertices[at(v)]) - offset) < thin) face.loop.push_back(v);
    // Around the middle of the face, counterclockwise.
    Vector3d middle = Vector3d::Zero();
    for (const int v : face.loop)
      middle += p.vertices[at(v)] / static_cast<double>(face.loop.size());
    const Vector3d x = (p.vertices[at(face.loop[0])] - middle).normalized(), y = n.cross(x);
    const auto angle = [&](int v) {
      const Vector3d d = p.vertices[at(v)] - middle;
      return std::atan2(y.dot(d), x.dot(d));
    };
    std::sort(face.loop.begin(), face.loop.end(),
              [&](int a, int b) { return angle(a) < angle(b); });
    p.faces.push_back(face);
  }
  if (p.faces.size() < 4) throw flat();
  finish(p);
  if (!(p.size > thin)) throw flat();
  return p;
}

}  // namespace

Polyhedron make_polyhedron(const Shape& shape) {
  return shape.kind == ShapeKind::box ? box(shape.size) : hull(shape.points);
}

void place(const Polyhedron& from, const Pose& pose, const Vector3d& origin, Polyhedron& to) {
  const Vector3d move = pose.position - origin;
  to.size = from.size;
  to.vertices.resize(from.vertices.size());
  for (std::size_t k = 0; k < from.vertices.size(); ++k)
    to.vertices[k] = move + pose.rotation * from.vertices[k];
  to.faces.resize(from.faces.size());
  for (std::size_t k = 0; k < from.faces.size(); ++k) {
    to.faces[k].normal = pose.rotation * from.faces[k].normal;
    to.faces[k].offset = from.faces[k].offset + to.faces[k].normal.dot(move);
  }
}

}  // namespace tether::contact::detail
