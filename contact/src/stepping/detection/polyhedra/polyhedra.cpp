// Tether: collision of polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/polyhedra.hpp"

#include <algorithm>
#include <limits>

#include "stepping/detection/collide.hpp"
#include "stepping/detection/polyhedra/edge_contacts.hpp"
#include "stepping/detection/polyhedra/round_contacts.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

// Sets `to` to a polyhedron at its pose, relative to a common origin.
void place(const Polyhedron& shape, const Pose& pose, const Vector3d& origin, Placed& to) {
  to.shape = &shape;
  to.rotation = pose.rotation;
  place(shape, pose, origin, to.now);
}

}  // namespace

bool meet_as_polyhedra(ShapeKind a, ShapeKind b) {
  if (!is_polyhedron(b)) std::swap(a, b);
  return is_polyhedron(b) &&
         (is_polyhedron(a) || a == ShapeKind::capsule ||
          (!form(b).has_nearest() && (a == ShapeKind::sphere || a == ShapeKind::points)));
}

void PolyhedraContacts::collide(const Shape& a, const Polyhedron& of_a, const Pose& A,
                                const Shape& b, const Polyhedron& of_b, const Pose& B,
                                double margin, NearPoints& out, const SeamTest* seam_a,
                                const SeamTest* seam_b) {
  const int from = out.count;
  a_.is_seam = seam_a;
  b_.is_seam = seam_b;
  const Vector3d origin = A.position;
  if (is_polyhedron(a.kind) && is_polyhedron(b.kind)) {
    place(of_a, A, origin, a_);
    place(of_b, B, origin, b_);
    polyhedra(margin, out);
  } else {
    const bool turned = is_polyhedron(a.kind);
    place(turned ? of_a : of_b, turned ? A : B, origin, b_);
    Pose pose = turned ? B : A;
    pose.position -= origin;
    other_on_polyhedron(turned ? b : a, pose, margin, out);
    if (turned) turn(out, from);
  }
  for (int k = from; k < out.count; ++k) {
    out.point[k].on_first += origin;
    out.point[k].on_second += origin;
  }
}

void PolyhedraContacts::other_on_polyhedron(const Shape& other, Pose pose, double margin,
                                            NearPoints& out) {
  if (other.kind == ShapeKind::points)
    return points_on_polyhedron(other.points, pose, b_, margin, out);
  const bool capsule = other.kind == ShapeKind::capsule && other.length > 0;
  Round round{pose.position, Vector3d::Zero(), other.radius, capsule};
  if (capsule) round.half = 0.5 * other.length * pose.rotation.col(2);
  round_on_polyhedron(round, b_, margin, out);
}

void PolyhedraContacts::polyhedra(double margin, NearPoints& out) {
  const double size = std::min(a_.now.size, b_.now.size), tie = kTie * size;
  const double rounding = kEqual * size;
  const FaceAxis A = best_face(a_, b_, rounding);
  if (A.most >= margin) return;
  const FaceAxis B = best_face(b_, a_, rounding);
  if (B.most >= margin) return;
  if (A.face < 0 && B.face < 0) return;  // seams, or positions that are NaN: the step reports those
  const EdgeAxis E = best_edges(a_, b_, rounding);
  if (E.most >= margin) return;
  const double best = std::max(A.separation, B.separation);
  constexpr double kAll = -std::numeric_limits<double>::infinity();
  const int before = out.count;
  if (E.separation > best + tie) {
    crossing_edges(a_, b_, E, tie, margin, out);
    if (out.count == before) return;
    // The bodies may turn about a single point within the step. Points over the face that are
    // still open may close then, so they are added.
    if (!at_seam(out, before)) return over_face(A, B, tie, margin, size, 0, out);
  } else if (A.face >= 0 && B.face >= 0 && std::abs(A.separation - B.separation) < tie) {
    const Vector3d &nA = a_.face(A.face).normal, &nB = b_.face(B.face).normal;
    // Both faces separate equally well but are oblique to each other: edges touch.
    if (-nA.dot(nB) < 1 - 0.5 * kFlatAngle * kFlatAngle) {
      edge_along_edge(a_, b_, (nA - nB).normalized(), rounding, margin, out);
      if (out.count == before || !at_seam(out, before)) return;
    }
  }
  out.count = before;
  over_face(A, B, tie, margin, size, kAll, out);
}

bool PolyhedraContacts::at_seam(const NearPoints& out, int k) const {
  const NearPoint& p = out.point[linalg::at(k)];
  return a_.seam(p.on_first, -p.normal) || b_.seam(p.on_second, p.normal);
}

// The reference is the face of the first body unless that of the second one is clearly better, so
// that it does not alternate between touching faces.
void PolyhedraContacts::over_face(const FaceAxis& A, const FaceAxis& B, double tie, double margin,
                                  double size, double least, NearPoints& out) {
  if (A.separation >= B.separation - tie) {
    const int from = out.count;
    clipper_.clip(a_, A.face, b_, least, margin, size, 0, out);
    turn(out, from);
  } else {
    clipper_.clip(b_, B.face, a_, least, margin, size, 1 << 15, out);
  }
}

}  // namespace tether::contact::detail
