// Tether: convex polyhedra. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <tether/contact/shapes.hpp>
#include <tether/linalg/block3.hpp>
#include <vector>

namespace tether::contact::detail {

// Lengths that differ by less than this part of the smaller thickness are equal. The first of equal
// candidates is taken, so that the choice does not change with the attitude.
constexpr double kEqual = 1e-12;

struct Polyhedron {
  struct Face {
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // outwards
    double offset = 0;                                  // normal . x on the face
    std::vector<int> loop;  // vertices, counterclockwise seen from outside
    // The convex pieces of it that no other part of the body lies against; see seams.hpp.
    struct Piece {
      std::vector<int> loop;
      std::vector<char> seam;  // of each edge: whether another part goes on beyond it in the plane
    };
    std::vector<Piece> open;
  };
  struct Edge {
    int from, to;
    int left, right;  // faces
  };
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Face> faces;
  std::vector<Edge> edges;
  double size = 0;  // smallest width across a face, m: the scale of its tolerances
};

/// The polyhedron of a box or a convex shape. Throws std::invalid_argument if the points are flat.
Polyhedron make_polyhedron(const Shape& shape);

/// Writes the polyhedron at a pose, relative to `origin`, into `to`.
void place(const Polyhedron& from, const Pose& pose, const Eigen::Vector3d& origin, Polyhedron& to);

}  // namespace tether::contact::detail
