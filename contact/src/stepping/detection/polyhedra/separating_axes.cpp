// Tether: the axes along which two polyhedra lie farthest apart. SPDX-License-Identifier:
// BSD-3-Clause
#include "stepping/detection/polyhedra/separating_axes.hpp"

#include <algorithm>

#include "stepping/detection/polyhedra/edge_contacts.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// All that b turns to face f of a is a seam.
bool meets_seam(const Placed& a, int f, const Placed& b, double least, double rounding) {
  const Vector3d& n = a.face(f).normal;
  return b.is_seam != nullptr &&
         std::none_of(b.now.vertices.begin(), b.now.vertices.end(), [&](const Vector3d& v) {
           return n.dot(v) <= least + rounding && !b.seam(v, -n);
         });
}

bool meet_at_seam(const Placed& a, const Placed& b, const EdgeAxis& axis) {
  if (a.is_seam == nullptr && b.is_seam == nullptr) return false;
  const Polyhedron::Edge &e = a.shape->edges[at(axis.first)], &g = b.shape->edges[at(axis.second)];
  const Vector3d &p = a.vertex(e.from), &q = b.vertex(g.from);
  Vector3d on_a, on_b;
  nearest(p, a.vertex(e.to) - p, q, b.vertex(g.to) - q, on_a, on_b);
  return a.seam(on_a, axis.normal) || b.seam(on_b, -axis.normal);
}

// The search among parts with seams leaves out axes; both bodies without are the common case.
template <bool kSeams>
FaceAxis best_face_of(const Placed& a, const Placed& b, double rounding) {
  FaceAxis best;
  for (int f = 0; f < static_cast<int>(a.now.faces.size()); ++f) {
    double least = std::numeric_limits<double>::infinity();
    for (const Vector3d& v : b.now.vertices) least = std::min(least, a.face(f).normal.dot(v));
    const double separation = least - a.face(f).offset;
    if constexpr (kSeams) {
      best.most = std::max(best.most, separation);
      if (a.shape->faces[at(f)].open.empty()) continue;
    }
    if (!(separation > best.separation + rounding)) continue;
    if (kSeams && meets_seam(a, f, b, least, rounding)) continue;
    best.separation = separation;
    best.face = f;
  }
  if (!kSeams) best.most = best.separation;
  return best;
}

// An edge is an arc between the normals of its faces on the Gauss sphere. Only edges whose arcs
// cross can touch (Gregorius, The Separating Axis Test between Convex Polyhedra, 2013).
template <bool kSeams>
EdgeAxis best_edges_of(const Placed& a, const Placed& b, double rounding) {
  EdgeAxis best;
  double most = best.most, largest = best.separation + rounding;
  for (int i = 0; i < static_cast<int>(a.shape->edges.size()); ++i) {
    const Polyhedron::Edge& e = a.shape->edges[at(i)];
    const Vector3d &n1 = a.face(e.left).normal, &n2 = a.face(e.right).normal;
    const Vector3d u = a.vertex(e.to) - a.vertex(e.from);
    for (int j = 0; j < static_cast<int>(b.shape->edges.size()); ++j) {
      const Polyhedron::Edge& g = b.shape->edges[at(j)];
      const Vector3d m1 = -b.face(g.left).normal, m2 = -b.face(g.right).normal;
      const Vector3d v = b.vertex(g.to) - b.vertex(g.from);
      const double s1 = m1.dot(u), s2 = m2.dot(u), t1 = n1.dot(v), t2 = n2.dot(v);
      if (s1 * s2 >= 0 || t1 * t2 >= 0 || s1 * t2 <= 0) continue;
      Vector3d n = u.cross(v);
      const double length = n.norm();
      if (!(length > 1e-6 * u.norm() * v.norm())) continue;
      n /= length;
      if (n.dot(n1) + n.dot(n2) < 0) n = -n;
      const double separation = n.dot(b.vertex(g.from) - a.vertex(e.from));
      if constexpr (kSeams) most = std::max(most, separation);
      if (!(separation > largest)) continue;
      if (kSeams && meet_at_seam(a, b, {separation, i, j, n, 0})) continue;
      best = {separation, i, j, n, 0};
      largest = separation + rounding;
    }
  }
  best.most = kSeams ? most : best.separation;
  return best;
}

bool have_seams(const Placed& a, const Placed& b) {
  return a.is_seam != nullptr || b.is_seam != nullptr;
}

}  // namespace

FaceAxis best_face(const Placed& a, const Placed& b, double rounding) {
  return have_seams(a, b) ? best_face_of<true>(a, b, rounding)
                          : best_face_of<false>(a, b, rounding);
}

EdgeAxis best_edges(const Placed& a, const Placed& b, double rounding) {
  return have_seams(a, b) ? best_edges_of<true>(a, b, rounding)
                          : best_edges_of<false>(a, b, rounding);
}

}  // namespace tether::contact::detail
