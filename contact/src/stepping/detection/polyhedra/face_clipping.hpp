// Tether: points of a polyhedron over a face of another. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "stepping/detection/polyhedra/separating_axes.hpp"

namespace tether::contact::detail {

// Clips faces to faces. The storage is reused between pairs of bodies.
class FaceClipper {
 public:
  // Adds the points of `other` over the reference face with gaps between `least` and `margin`.
  // on_first of a result lies on `other`; the normal is that of the reference face. `size` is the
  // smaller thickness of both; `mark` is added to the features.
  void clip(const Placed& reference, int face, const Placed& other, double least, double margin,
            double size, int mark, NearPoints& out);

 private:
  // A line of a piece of either face; see Polyhedron::Face.
  struct Line {
    int number;
    bool of_reference, seam;
  };
  // A corner of the polygon that is being clipped; `edge` is the edge from it to the next corner.
  // A corner on a seam is none of the surface, nor is the point where the other body's border
  // passes one.
  struct Corner {
    Eigen::Vector3d point;
    int feature;
    Line edge;
    bool seam;
  };

  int lowest_face(const Placed& other, const Eigen::Vector3d& n, double same);
  void clip_to(const Eigen::Vector3d& inward, const Eigen::Vector3d& from,
               const Eigen::Vector3d& to, const Line& plane, double same);
  void merge(double same);
  void clip_piece(const Placed& reference, int face, const Polyhedron::Face::Piece& to,
                  const Placed& other, const Polyhedron::Face::Piece& subject, int first,
                  double same);

  std::vector<Corner> polygon_, clipped_;
  std::vector<double> height_;
};

}  // namespace tether::contact::detail
