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

// A face is preferred to a pair of edges whose separation is larger by less than this part of the
// smaller thickness.
constexpr double kTie = 1e-4;

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
                                double margin, NearPoints& out) {
  const int from = out.count;
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
  if (A.separation >= margin) return;
  const FaceAxis B = best_face(b_, a_, rounding);
  if (B.separation >= margin) return;
  if (A.face < 0 || B.face < 0) return;  // positions are NaN, which the step reports
  const EdgeAxis E = best_edges(a_, b_, rounding);
  if (E.separation >= margin) return;
  const double best = std::max(A.separation, B.separation);
  if (E.separation > best + tie) {
    const int before = out.count;
    crossing_edges(a_, b_, E, tie, margin, out);
    // The bodies may turn about a single point within the step. Points over the face that are
    // still open may close then, so they are added.
    if (out.count > before) over_face(A, B, tie, margin, size, 0, out);
    return;
  }
  const Vector3d &nA = a_.face(A.face).normal, &nB = b_.face(B.face).normal;
  // Both faces separate equally well but are oblique to each other: edges touch.
  if (std::abs(A.separation - B.separation) < tie &&
      -nA.dot(nB) < 1 - 0.5 * kFlatAngle * kFlatAngle)
    return edge_along_edge(a_, b_, (nA - nB).normalized(), rounding, margin, out);
  over_face(A, B, tie, margin, size, -std::numeric_limits<double>::infinity(), out);
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
