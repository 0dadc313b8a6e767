// Tether: the axes along which two polyhedra lie farthest apart. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <limits>
#include <vector>

#include "stepping/detection/polyhedra/polyhedron.hpp"

namespace tether::contact::detail {

// Whether the point x of a part, with the outward normal n, is no surface of its body.
using SeamTest = std::function<bool(const Eigen::Vector3d& x, const Eigen::Vector3d& n)>;

// A polyhedron at its pose: `shape` has the topology, `now` the coordinates in world axes relative
// to a common origin.
struct Placed {
  const Polyhedron* shape;
  Polyhedron now;
  Eigen::Matrix3d rotation;
  const SeamTest* is_seam;  // null where the part touches no other of its body
  bool seam(const Eigen::Vector3d& x, const Eigen::Vector3d& n) const {
    return is_seam != nullptr && (*is_seam)(x, n);
  }
  const Polyhedron::Face& face(int f) const { return now.faces[linalg::at(f)]; }
  const std::vector<int>& loop(int f) const { return shape->faces[linalg::at(f)].loop; }
  const Eigen::Vector3d& vertex(int v) const { return now.vertices[linalg::at(v)]; }
  int loop_size(int f) const { return static_cast<int>(loop(f).size()); }
  const Eigen::Vector3d& corner(int f, int k) const {
    return vertex(loop(f)[linalg::at(k < loop_size(f) ? k : k - loop_size(f))]);
  }
  // Direction from edge k of a loop into its face f. It is computed in the axes of the shape:
  // coordinates at a pose are rounded relative to the distance from the origin, which would turn
  // short edges.
  Eigen::Vector3d inward(int f, const std::vector<int>& of, std::size_t k) const {
    const std::vector<Eigen::Vector3d>& v = shape->vertices;
    const Eigen::Vector3d along =
        v[linalg::at(of[k + 1 < of.size() ? k + 1 : 0])] - v[linalg::at(of[k])];
    return rotation * shape->faces[linalg::at(f)].normal.cross(along).normalized();
  }
};

struct FaceAxis {
  double separation = -std::numeric_limits<double>::infinity();
  int face = -1;
  // The largest separation by any face. Bodies touch along those that lead out of both.
  double most = -std::numeric_limits<double>::infinity();
};

struct EdgeAxis {
  double separation = -std::numeric_limits<double>::infinity();
  int first = -1, second = -1;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // from the first body to the second
  double most = -std::numeric_limits<double>::infinity();
};

// The face of a with the largest separation from b. Separations that differ by less than `rounding`
// are equal, and the first face is taken. Faces are left out that are seams of a, or to which b
// turns a seam.
FaceAxis best_face(const Placed& a, const Placed& b, double rounding);
// The pair of edges whose product has the largest separation, but for seams.
EdgeAxis best_edges(const Placed& a, const Placed& b, double rounding);

}  // namespace tether::contact::detail
