// Tether: convex polyhedra. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <tether/contact/shapes.hpp>
#include <tether/linalg/index.hpp>
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

struct Parts;

/// A part of a body among those that lie against it (seams.hpp); without any: a body of one part.
struct Seam {
  const Parts* parts = nullptr;
  int part = -1;  // its surface
  /// Whether the point x, with the outward normal n, is no surface of the body.
  bool at(const Eigen::Vector3d& x, const Eigen::Vector3d& n) const;
};

// A polyhedron at its pose: `shape` has the topology, `now` the coordinates in world axes relative
// to a common origin.
struct Placed {
  const Polyhedron* shape;
  Polyhedron now;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d origin;
  Seam seam;
  bool is_seam(const Eigen::Vector3d& x, const Eigen::Vector3d& n) const {
    return seam.parts != nullptr && seam.at(origin + x, n);
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

/// Sets `to` to the polyhedron at a pose, relative to `origin`.
void place(const Polyhedron& from, const Pose& pose, const Eigen::Vector3d& origin, Placed& to);

}  // namespace tether::contact::detail
