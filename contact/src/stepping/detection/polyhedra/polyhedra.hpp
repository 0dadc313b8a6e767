// Tether: collision of polyhedra (detection, section 2). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/detection/polyhedra/face_clipping.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

inline bool is_polyhedron(ShapeKind k) { return form(k).family() == ShapeForm::Family::polyhedron; }

/// Boxes and convex hulls against each other, capsules against both, spheres and points against
/// those whose nearest point has no formula.
bool meet_as_polyhedra(ShapeKind a, ShapeKind b);

/// Their points. Keeps its storage between pairs.
///
/// Touching faces are found to round-off and without any margin or skin: the separating axis is
/// chosen among all face normals and edge products (detection, 2), then the face that lies
/// against the reference face is clipped to it.
///
/// Normals. A face gives its normal. Crossing edges: their product. Where an edge lies along an
/// edge (or a corner on one) and the faces of both bodies separate them equally well, there is no
/// unique normal: it is the mean of the two faces' (cards that lean against each other by their top
/// edges: horizontal).
class PolyhedraContacts {
 public:
  /// Adds all points with a gap below `margin`; normals point from b to a. The polyhedra are those
  /// of the shapes that are such.
  void collide(const Shape& a, const Polyhedron& of_a, const Pose& A, const Shape& b,
               const Polyhedron& of_b, const Pose& B, double margin, NearPoints& out);

 private:
  void other_on_polyhedron(const Shape& other, Pose pose, double margin, NearPoints& out);
  void polyhedra(double margin, NearPoints& out);
  void over_face(const FaceAxis& A, const FaceAxis& B, double tie, double margin, double size,
                 double least, NearPoints& out);

  Placed a_, b_;
  FaceClipper clipper_;
};

}  // namespace tether::contact::detail
