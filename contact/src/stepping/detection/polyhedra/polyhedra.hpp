// Tether: collision of polyhedra (detection, section 2). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/detection/polyhedra/face_clipping.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// A face is preferred to a pair of edges whose separation is larger by less than this part of the
/// smaller thickness.
constexpr double kTie = 1e-4;

inline bool is_polyhedron(ShapeKind k) { return form(k).family() == ShapeForm::Family::polyhedron; }

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
  /// the polyhedra of boxes and hulls, ignored for other shapes. The tests, of points about the
  /// position of a, are for those that are parts of a body.
  void collide(const Shape& a, const Polyhedron& of_a, const Pose& A, const Shape& b,
               const Polyhedron& of_b, const Pose& B, double margin, NearPoints& out,
               const SeamTest* seam_a = nullptr, const SeamTest* seam_b = nullptr);

 private:
  void other_on_polyhedron(const Shape& other, Pose pose, double margin, NearPoints& out);
  void polyhedra(double margin, NearPoints& out);
  bool at_seam(const NearPoints& out, int k) const;
  void over_face(const FaceAxis& A, const FaceAxis& B, double tie, double margin, double size,
                 double least, NearPoints& out);

  Placed a_, b_;
  FaceClipper clipper_;
};

}  // namespace tether::contact::detail
