// Tether: the axes along which two polyhedra lie farthest apart. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "stepping/detection/polyhedra/polyhedron.hpp"

namespace tether::contact::detail {

// A body at its pose: shared topology, own coordinates (world axes, about a common origin).
struct Placed {
  const Polyhedron* shape;
  Polyhedron now;
  Eigen::Matrix3d rotation;
  const Polyhedron::Face& face(int f) const { return now.faces[linalg::at(f)]; }
  const std::vector<int>& loop(int f) const { return shape->faces[linalg::at(f)].loop; }
  const Eigen::Vector3d& vertex(int v) const { return now.vertices[linalg::at(v)]; }
  int loop_size(int f) const { return static_cast<int>(loop(f).size()); }
  const Eigen::Vector3d& corner(int f, int k) const {
    return vertex(loop(f)[linalg::at(k < loop_size(f) ? k : k - loop_size(f))]);
  }
  // Into the face from its edge k. From the shape's own coordinates: those of a pose are rounded to
  // the distance from the common origin, and a short edge would turn by that.
  Eigen::Vector3d inward(int f, int k) const {
    const int next = k + 1 < loop_size(f) ? k + 1 : 0;
    const std::vector<Eigen::Vector3d>& v = shape->vertices;
    const Eigen::Vector3d along =
        v[linalg::at(loop(f)[linalg::at(next)])] - v[linalg::at(loop(f)[linalg::at(k)])];
    return rotation * shape->faces[linalg::at(f)].normal.cross(along).normalized();
  }
};

struct FaceAxis {
  double separation = -std::numeric_limits<double>::infinity();
  int face = -1;
};

struct EdgeAxis {
  double separation = -std::numeric_limits<double>::infinity();
  int first = -1, second = -1;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // from the first body to the second
};

// The face of `a` beyond whose plane all of `b` lies farthest. rounding: separations that differ by
// less are equal, and the first is taken in every attitude.
FaceAxis best_face(const Placed& a, const Placed& b, double rounding);
// The same with the products of their edges.
EdgeAxis best_edges(const Placed& a, const Placed& b, double rounding);

}  // namespace tether::contact::detail
