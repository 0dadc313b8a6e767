// Tether: convex polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/polyhedron.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// Newell's normal of a closed loop; its length is twice the area.
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
    face.open = {{face.loop, std::vector<char>(face.loop.size(), 0)}};
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

}  // namespace

Polyhedron make_polyhedron(const Shape& shape) {
  Polyhedron p;
  form(shape.kind).make_polyhedron(shape, p);
  finish(p);
  return p;
}

void place(const Polyhedron& from, const Pose& pose, const Vector3d& origin, Placed& to) {
  to.shape = &from;
  to.rotation = pose.rotation;
  to.origin = origin;
  const Vector3d move = pose.position - origin;
  to.now.size = from.size;
  to.now.vertices.resize(from.vertices.size());
  for (std::size_t k = 0; k < from.vertices.size(); ++k)
    to.now.vertices[k] = move + pose.rotation * from.vertices[k];
  to.now.faces.resize(from.faces.size());
  for (std::size_t k = 0; k < from.faces.size(); ++k) {
    to.now.faces[k].normal = pose.rotation * from.faces[k].normal;
    to.now.faces[k].offset = from.faces[k].offset + to.now.faces[k].normal.dot(move);
  }
}

}  // namespace tether::contact::detail
