// Tether: convex polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/polyhedron.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tether/linalg/convex_hull.hpp>
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

Polyhedron hull(const std::vector<Vector3d>& points) {
  Polyhedron p;
  std::map<std::size_t, int> number;  // of the points that are corners
  for (const std::vector<std::size_t>& corners : linalg::hull_faces(points)) {
    Polyhedron::Face face;
    for (const std::size_t k : corners) {
      const auto [place, fresh] = number.emplace(k, static_cast<int>(p.vertices.size()));
      if (fresh) p.vertices.push_back(points[k]);
      face.loop.push_back(place->second);
    }
    p.faces.push_back(face);
  }
  if (p.faces.empty()) throw std::invalid_argument("convex: the points lie in a plane");
  finish(p);
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
