// Tether: edges of polyhedra that touch. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/edge_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

void nearest(const Vector3d& p, const Vector3d& u, const Vector3d& q, const Vector3d& v,
             Vector3d& on_first, Vector3d& on_second) {
  const Vector3d w = p - q;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), uw = u.dot(w), vw = v.dot(w);
  const double square = uu * vv - uv * uv;
  double s = square > 1e-12 * uu * vv ? std::clamp((uv * vw - vv * uw) / square, 0.0, 1.0) : 0.5;
  const double t = std::clamp((vw + s * uv) / vv, 0.0, 1.0);
  s = std::clamp((t * uv - uw) / uu, 0.0, 1.0);
  on_first = p + s * u;
  on_second = q + t * v;
}

// The nearest points of two edges may be ends of these. Their distance is then larger than the
// separation along the product of the edges, and is the gap.
void crossing_edges(const Placed& a, const Placed& b, const EdgeAxis& E, double tie, double margin,
                    NearPoints& out) {
  const Polyhedron::Edge& e = a.shape->edges[at(E.first)];
  const Polyhedron::Edge& g = b.shape->edges[at(E.second)];
  Vector3d p, q;
  nearest(a.vertex(e.from), a.vertex(e.to) - a.vertex(e.from), b.vertex(g.from),
          b.vertex(g.to) - b.vertex(g.from), p, q);
  Vector3d n = -E.normal;
  double gap = E.separation;
  const Vector3d apart = p - q;
  if (gap > 0 && (apart - gap * n).norm() > tie) {
    gap = apart.norm();
    n = apart / gap;
  }
  if (gap < margin) out.add(p, q, n, gap, 0x7f10 + (E.first * 251 + E.second) % 0xef);
}

namespace {

// The edge of `a` that is farthest in direction m: among the edges of the farthest vertex the one
// most nearly at right angles to m. If none is within kFlatAngle, the vertex alone (from == to).
Polyhedron::Edge farthest(const Placed& a, const Vector3d& m, double rounding) {
  int v = 0;
  for (int k = 1; k < static_cast<int>(a.now.vertices.size()); ++k)
    if (m.dot(a.vertex(k)) > m.dot(a.vertex(v)) + rounding) v = k;
  Polyhedron::Edge best{v, v, -1, -1};
  double slope = kFlatAngle;
  for (const Polyhedron::Edge& e : a.shape->edges) {
    if (e.from != v && e.to != v) continue;
    const Vector3d u = a.vertex(e.to) - a.vertex(e.from);
    const double s = std::abs(m.dot(u)) / u.norm();
    if (s >= slope - kEqual) continue;
    slope = s;
    best = e;
  }
  return best;
}

}  // namespace

void edge_along_edge(const Placed& a, const Placed& b, const Vector3d& m, double rounding,
                     double margin, NearPoints& out) {
  const Polyhedron::Edge e = farthest(a, m, rounding), g = farthest(b, -m, rounding);
  const Vector3d p = a.vertex(e.from), u = a.vertex(e.to) - p;
  const Vector3d q = b.vertex(g.from), v = b.vertex(g.to) - q;
  const auto add = [&](const Vector3d& x, const Vector3d& y, int feature) {
    const double gap = m.dot(y - x);
    if (gap < margin) out.add(x, y, -m, gap, feature);
  };
  const double uu = u.squaredNorm(), vv = v.squaredNorm();
  if (uu == 0 || vv == 0) {  // a corner
    Vector3d x = p, y = q;
    if (uu > 0) x = p + std::clamp(u.dot(q - p) / uu, 0.0, 1.0) * u;
    if (vv > 0) y = q + std::clamp(v.dot(p - q) / vv, 0.0, 1.0) * v;
    return add(x, y, 0x7f00);
  }
  // Edges that cross in the view along m touch where they cross. An angle between them in a plane
  // that contains m does not count as crossing.
  if (std::abs(m.dot(u.cross(v))) > 1e-3 * std::sqrt(uu * vv)) {
    Vector3d x, y;
    nearest(p, u, q, v, x, y);
    return add(x, y, 0x7f01);
  }
  // Parallel edges touch at the ends of their overlap, given here by positions along the first one.
  const double from = std::max(0.0, std::min(u.dot(q - p), u.dot(q + v - p)) / uu);
  const double to = std::min(1.0, std::max(u.dot(q - p), u.dot(q + v - p)) / uu);
  if (from > to) {  // no overlap: the nearest ends
    Vector3d x, y;
    nearest(p, u, q, v, x, y);
    return add(x, y, 0x7f01);
  }
  for (int end = 0; end < 2; ++end) {
    const Vector3d x = p + (end == 0 ? from : to) * u;
    const Vector3d y = q + std::clamp(v.dot(x - q) / vv, 0.0, 1.0) * v;
    add(x, y, 0x7f02 + end);
  }
}

}  // namespace tether::contact::detail
