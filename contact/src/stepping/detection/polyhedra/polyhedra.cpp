// Tether: collision of polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/polyhedra.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stepping/detection/collide.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr double kNone = -std::numeric_limits<double>::infinity();

struct FaceAxis {
  double separation = kNone;
  int face = -1;
  double most = kNone;  // by any face, also by one that is a seam
};

struct EdgeAxis {
  double separation = kNone;
  int first = -1, second = -1;
  Vector3d normal = Vector3d::Zero();  // from the first body to the second
  double most = kNone;
};

// Nearest points of the segments p .. p + u and q .. q + v.
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

void nearest(const Placed& a, const Polyhedron::Edge& e, const Placed& b, const Polyhedron::Edge& g,
             Vector3d& on_first, Vector3d& on_second) {
  nearest(a.vertex(e.from), a.vertex(e.to) - a.vertex(e.from), b.vertex(g.from),
          b.vertex(g.to) - b.vertex(g.from), on_first, on_second);
}

// All that b turns to face f of a is a seam.
bool meets_seam(const Placed& a, int f, const Placed& b, double least, double rounding) {
  const Vector3d& n = a.face(f).normal;
  return b.seam.parts != nullptr &&
         std::none_of(b.now.vertices.begin(), b.now.vertices.end(), [&](const Vector3d& v) {
           return n.dot(v) <= least + rounding && !b.is_seam(v, -n);
         });
}

// The face of a with the largest separation from b. Separations that differ by less than `rounding`
// are equal, and the first face is taken. Faces are left out that are seams of a, or to which b
// turns a seam.
FaceAxis best_face(const Placed& a, const Placed& b, double rounding) {
  FaceAxis best;
  for (int f = 0; f < static_cast<int>(a.now.faces.size()); ++f) {
    double least = std::numeric_limits<double>::infinity();
    for (const Vector3d& v : b.now.vertices) least = std::min(least, a.face(f).normal.dot(v));
    const double separation = least - a.face(f).offset;
    best.most = std::max(best.most, separation);
    if (!(separation > best.separation + rounding) || a.shape->faces[at(f)].open.empty() ||
        meets_seam(a, f, b, least, rounding))
      continue;
    best.separation = separation;
    best.face = f;
  }
  return best;
}

// The pair of edges whose product has the largest separation, but for seams. An edge is an arc
// between the normals of its faces on the Gauss sphere. Only edges whose arcs cross can touch
// (Gregorius, The Separating Axis Test between Convex Polyhedra, 2013).
EdgeAxis best_edges(const Placed& a, const Placed& b, double rounding) {
  const bool seams = a.seam.parts != nullptr || b.seam.parts != nullptr;
  const auto meet_at_seam = [&](const Polyhedron::Edge& e, const Polyhedron::Edge& g,
                                const Vector3d& n) {
    Vector3d on_a, on_b;
    nearest(a, e, b, g, on_a, on_b);
    return a.is_seam(on_a, n) || b.is_seam(on_b, -n);
  };
  EdgeAxis best;
  double most = kNone, largest = kNone;
  for (int i = 0; i < static_cast<int>(a.shape->edges.size()); ++i) {
    const Polyhedron::Edge& e = a.shape->edges[at(i)];
    const Vector3d &n1 = a.face(e.left).normal, &n2 = a.face(e.right).normal;
    const Vector3d u = a.vertex(e.to) - a.vertex(e.from);
    for (int j = 0; j < static_cast<int>(b.shape->edges.size()); ++j) {
      const Polyhedron::Edge& g = b.shape->edges[at(j)];
      const double s1 = b.face(g.left).normal.dot(u), s2 = b.face(g.right).normal.dot(u);
      if (s1 * s2 >= 0) continue;
      const Vector3d v = b.vertex(g.to) - b.vertex(g.from);
      const double t1 = n1.dot(v), t2 = n2.dot(v);
      if (t1 * t2 >= 0 || s1 * t2 >= 0) continue;
      Vector3d n = u.cross(v);
      const double length = n.norm();
      if (!(length > 1e-6 * u.norm() * v.norm())) continue;
      n /= length;
      if (n.dot(n1) + n.dot(n2) < 0) n = -n;
      const double separation = n.dot(b.vertex(g.from) - a.vertex(e.from));
      most = std::max(most, separation);
      if (!(separation > largest) || (seams && meet_at_seam(e, g, n))) continue;
      best = {separation, i, j, n, 0};
      largest = separation + rounding;
    }
  }
  best.most = most;
  return best;
}

// Contact of the two edges of an axis. Their nearest points may be ends of them: a distance from
// the axis above `tie`. It is then larger than the separation along the product of the edges, and
// is the gap.
void crossing_edges(const Placed& a, const Placed& b, const EdgeAxis& E, double tie, double margin,
                    NearPoints& out) {
  Vector3d p, q;
  nearest(a, a.shape->edges[at(E.first)], b, b.shape->edges[at(E.second)], p, q);
  Vector3d n = -E.normal;
  double gap = E.separation;
  const Vector3d apart = p - q;
  if (gap > 0 && (apart - gap * n).norm() > tie) {
    gap = apart.norm();
    n = apart / gap;
  }
  if (gap < margin) out.add(p, q, n, gap, 0x7f10 + (E.first * 251 + E.second) % 0xef);
}

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

// Contacts of the edges or corners that are farthest along the unit vector m, which points from a
// to b.
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
  if (uu == 0 || vv == 0)  // a corner
    return add(nearest_on_segment(q, p, a.vertex(e.to)), nearest_on_segment(p, q, b.vertex(g.to)),
               0x7f00);
  // Parallel edges touch at the ends of their overlap, given here by positions along the first one.
  const double from = std::max(0.0, std::min(u.dot(q - p), u.dot(q + v - p)) / uu);
  const double to = std::min(1.0, std::max(u.dot(q - p), u.dot(q + v - p)) / uu);
  // Edges that cross in the view along m touch where they cross, others without overlap at their
  // nearest ends. An angle between them in a plane that contains m does not count as crossing.
  if (std::abs(m.dot(u.cross(v))) > 1e-3 * std::sqrt(uu * vv) || from > to) {
    Vector3d x, y;
    nearest(p, u, q, v, x, y);
    return add(x, y, 0x7f01);
  }
  for (int end = 0; end < 2; ++end) {
    const Vector3d x = p + (end == 0 ? from : to) * u;
    add(x, nearest_on_segment(x, q, b.vertex(g.to)), 0x7f02 + end);
  }
}

// The point of the surface nearest to c. Inside, the way out leads through a face that is open.
Nearest nearest_point(const Placed& b, const Vector3d& c) {
  const auto is_open = [&](int f) { return !b.shape->faces[at(f)].open.empty(); };
  int best = 0;
  double height = kNone;
  for (int f = 0; f < static_cast<int>(b.now.faces.size()); ++f) {
    const double h = b.face(f).normal.dot(c) - b.face(f).offset;
    if (h > height && (h > 0 || is_open(f))) {
      height = h;
      best = f;
    }
  }
  if (!is_open(best) && height < 0) return {};
  Vector3d normal = b.face(best).normal, point = c - height * normal;
  if (height <= 0) return {point, normal, height};
  bool over = true;
  for (int k = 0; k < b.loop_size(best); ++k) {
    const Vector3d& p = b.corner(best, k);
    over = over && normal.cross(b.corner(best, k + 1) - p).dot(c - p) >= 0;
  }
  if (over) return {point, normal, height};
  double least = std::numeric_limits<double>::infinity();
  for (const Polyhedron::Edge& e : b.shape->edges) {
    const Vector3d x = nearest_on_segment(c, b.vertex(e.from), b.vertex(e.to));
    const double distance = (c - x).norm();
    if (distance < least) {
      least = distance;
      point = x;
    }
  }
  // If c is on the surface up to rounding the difference has no direction: the normal of the face
  // stays.
  if (least > kEqual * b.now.size) normal = (c - point) / least;
  return {point, normal, least};
}

// The points at which the axis of a capsule, from .. from + u, passes an edge between its ends.
void axis_on_edges(const Vector3d& from, const Vector3d& u, double radius, const Placed& b,
                   double margin, NearPoints& out) {
  for (std::size_t k = 0; k < b.shape->edges.size(); ++k) {
    const Polyhedron::Edge& e = b.shape->edges[k];
    const Vector3d &q = b.vertex(e.from), v = b.vertex(e.to) - q;
    if (u.cross(v).squaredNorm() < 1e-6 * u.squaredNorm() * v.squaredNorm()) continue;
    Vector3d x, y;
    nearest(from, u, q, v, x, y);
    const double s = u.dot(x - from) / u.squaredNorm(), t = v.dot(y - q) / v.squaredNorm();
    if (s <= 0 || s >= 1 || t <= 0 || t >= 1) continue;
    Vector3d n = x - y;
    const double distance = n.norm();
    if (!(distance > 0) || distance - radius >= margin) continue;
    n /= distance;
    // The edge is nearest if the direction to the axis lies between the normals of its faces. It
    // may coincide with one of them where the capsule lies flat on a face and reaches beyond it.
    const double slack = kUpright * v.norm();
    const double left = n.dot(b.face(e.left).normal.cross(v));
    const double right = n.dot(b.face(e.right).normal.cross(v));
    if (std::min(left, right) > slack || std::max(left, right) < -slack) continue;
    if (n.dot(b.face(e.left).normal + b.face(e.right).normal) <= 0) continue;
    out.add(x - radius * n, y, n, distance - radius, kCapsuleOnEdge + static_cast<int>(k % 60000));
  }
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
                                double margin, NearPoints& out, const Seam& seam_a,
                                const Seam& seam_b) {
  const int from = out.count;
  a_.seam = seam_a;
  b_.seam = seam_b;
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

// Balls, capsules and single points; `pose` has the same origin as the polyhedron.
void PolyhedraContacts::other_on_polyhedron(const Shape& other, const Pose& pose, double margin,
                                            NearPoints& out) {
  const bool points = other.kind == ShapeKind::points;
  const double radius = points ? 0 : other.radius;
  const auto ball = [&](const Vector3d& c, int feature) {
    const Nearest to = nearest_point(b_, c);
    const double gap = to.gap - radius;
    if (gap < margin) out.add(c - radius * to.normal, to.point, to.normal, gap, feature);
  };
  if (points) {
    for (std::size_t k = 0; k < other.points.size(); ++k)
      ball(pose.position + pose.rotation * other.points[k], static_cast<int>(k));
  } else if (other.kind == ShapeKind::capsule && other.length > 0) {
    const Vector3d half = 0.5 * other.length * pose.rotation.col(2);
    ball(pose.position - half, 0);
    ball(pose.position + half, 1);
    axis_on_edges(pose.position - half, 2 * half, radius, b_, margin, out);
  } else {
    ball(pose.position, 0);
  }
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
  const int before = out.count;
  const auto at_seam = [&] {
    const NearPoint& p = out.point[at(before)];
    return a_.is_seam(p.on_first, -p.normal) || b_.is_seam(p.on_second, p.normal);
  };
  // The reference is the face of the first body unless that of the second one is clearly better, so
  // that it does not alternate between touching faces.
  const auto over_face = [&](double least) {
    const int from = out.count;
    if (A.separation < B.separation - tie)
      return clipper_.clip(b_, B.face, a_, least, margin, size, 1 << 15, out);
    clipper_.clip(a_, A.face, b_, least, margin, size, 0, out);
    turn(out, from);
  };
  if (E.separation > std::max(A.separation, B.separation) + tie) {
    crossing_edges(a_, b_, E, tie, margin, out);
    if (out.count == before) return;
    // The bodies may turn about a single point within the step. Points over the face that are
    // still open may close then, so they are added.
    if (!at_seam()) return over_face(0);
  } else if (A.face >= 0 && B.face >= 0 && std::abs(A.separation - B.separation) < tie) {
    const Vector3d &nA = a_.face(A.face).normal, &nB = b_.face(B.face).normal;
    // Both faces separate equally well but are oblique to each other: edges touch.
    if (-nA.dot(nB) < 1 - 0.5 * kFlatAngle * kFlatAngle) {
      edge_along_edge(a_, b_, (nA - nB).normalized(), rounding, margin, out);
      if (out.count == before || !at_seam()) return;
    }
  }
  out.count = before;
  over_face(kNone);
}

}  // namespace tether::contact::detail
