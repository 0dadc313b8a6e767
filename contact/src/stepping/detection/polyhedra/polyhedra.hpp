// Tether: collision of polyhedra (detection, section 2). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "stepping/detection/polyhedra/polyhedron.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// A face is preferred to a pair of edges whose separation is larger by less than this part of the
/// smaller thickness.
constexpr double kTie = 1e-4;

inline bool is_polyhedron(ShapeKind k) { return form(k).family() == ShapeForm::Family::polyhedron; }

constexpr int kCapsuleOnEdge = 2;  // first feature of points at which its axis passes an edge

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

/// Whether PolyhedraContacts serves this pair: boxes and hulls against each other, capsules against
/// both, spheres and points against hulls, whose nearest point has no formula.
bool meet_as_polyhedra(ShapeKind a, ShapeKind b);

/// Contacts of such pairs. The storage is reused between pairs.
///
/// The separating axis is chosen among all face normals and edge products (detection, section 2).
/// The face opposite to the reference face is then clipped to it. Touching faces are found to
/// rounding, without any margin or skin.
///
/// The normal is that of the reference face, or the product of crossing edges. Where an edge lies
/// along an edge, or a corner on one, and the faces of both bodies separate equally well, no normal
/// is distinguished. It is then the mean of the normals of the two faces: horizontal for two cards
/// that lean against each other.
class PolyhedraContacts {
 public:
  /// Adds all contacts with a gap below `margin`; normals point from b to a. `of_a` and `of_b` are
  /// the polyhedra of boxes and hulls, ignored for other shapes.
  void collide(const Shape& a, const Polyhedron& of_a, const Pose& A, const Shape& b,
               const Polyhedron& of_b, const Pose& B, double margin, NearPoints& out,
               const Seam& seam_a = {}, const Seam& seam_b = {});

 private:
  void other_on_polyhedron(const Shape& other, const Pose& pose, double margin, NearPoints& out);
  void polyhedra(double margin, NearPoints& out);

  Placed a_, b_;
  FaceClipper clipper_;
};

}  // namespace tether::contact::detail
