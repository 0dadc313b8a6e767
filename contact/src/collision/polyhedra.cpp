// Tether: collision of polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/contact/polyhedra.hpp>
#include <unordered_map>

#include "collision/polyhedron.hpp"

namespace tether::contact {

using detail::Polyhedron;
using Eigen::Vector3d;

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Faces more oblique to each other than this have an edge contact between them.
constexpr double kParallel = 0.99875;  // cos 0.05
constexpr double kFlat = 1e-9;         // radian: along a face
constexpr double kAcross = 0.05;       // radian: an edge farthest in a direction, as a whole
// Parts of the smaller thickness: separations between which faces are preferred; merged corners;
// numbers that differ by rounding only, of which the first is taken in every attitude.
constexpr double kTie = 1e-4, kSame = 1e-7, kRounding = 1e-12;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A body at its pose: shared topology, own coordinates (world axes, about a common origin).
struct Placed {
  const Polyhedron* shape;
  Polyhedron now;
  Eigen::Matrix3d rotation;
  const Polyhedron::Face& face(int f) const { return now.faces[at(f)]; }
  const std::vector<int>& loop(int f) const { return shape->faces[at(f)].loop; }
  const Vector3d& vertex(int v) const { return now.vertices[at(v)]; }
  int loop_size(int f) const { return static_cast<int>(loop(f).size()); }
  const Vector3d& corner(int f, int k) const {
    return vertex(loop(f)[at(k < loop_size(f) ? k : k - loop_size(f))]);
  }
  // Into the face from its edge k. From the shape's own coordinates: those of a pose are rounded to
  // the distance from the common origin, and a short edge would turn by that.
  Vector3d inward(int f, int k) const {
    const int next = k + 1 < loop_size(f) ? k + 1 : 0;
    const std::vector<Vector3d>& v = shape->vertices;
    const Vector3d along = v[at(loop(f)[at(next)])] - v[at(loop(f)[at(k)])];
    return rotation * shape->faces[at(f)].normal.cross(along).normalized();
  }
};

struct FaceAxis {
  double separation = -kInfinity;
  int face = -1;
};

// The face of `a` beyond whose plane all of `b` lies farthest.
FaceAxis best_face(const Placed& a, const Placed& b, double rounding) {
  FaceAxis best;
  for (int f = 0; f < static_cast<int>(a.now.faces.size()); ++f) {
    double least = kInfinity;
    for (const Vector3d& v : b.now.vertices) least = std::min(least, a.face(f).normal.dot(v));
    const double separation = least - a.face(f).offset;
    if (separation > best.separation + rounding) best = {separation, f};
  }
  return best;
}

struct EdgeAxis {
  double separation = -kInfinity;
  int first = -1, second = -1;
  Vector3d normal = Vector3d::Zero();  // from the first body to the second
};

// Only edges whose arcs of normals cross can touch (Gregorius, The Separating Axis Test between
// Convex Polyhedra, 2013).
EdgeAxis best_edges(const Placed& a, const Placed& b, double rounding) {
  EdgeAxis best;
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
      if (separation > best.separation + rounding) best = {separation, i, j, n};
    }
  }
  return best;
}

// Nearest points of two segments that are not parallel.
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

// A corner of the polygon that is being clipped; `edge` follows it.
struct Corner {
  Vector3d point;
  int feature, edge;
};

class Polyhedra final : public PairCollision {
 public:
  bool serves(ShapeKind a, ShapeKind b) const override {
    const auto polyhedron = [](ShapeKind k) {
      return k == ShapeKind::box || k == ShapeKind::convex;
    };
    const auto round = [](ShapeKind k) {
      return k == ShapeKind::sphere || k == ShapeKind::capsule;
    };
    return (polyhedron(a) && (polyhedron(b) || round(b))) || (round(a) && polyhedron(b));
  }

  void add(int surface, const Shape& shape) override {
    Entry entry;
    entry.kind = shape.kind;
    entry.radius = shape.radius;
    entry.half = shape.kind == ShapeKind::capsule ? 0.5 * shape.length : 0;
    if (shape.kind == ShapeKind::box || shape.kind == ShapeKind::convex)
      entry.shape = detail::make_polyhedron(shape);
    entries_[surface] = std::move(entry);
  }

  void collide(int first, const Pose& first_pose, int second, const Pose& second_pose,
               double margin, NearPoints& out) override {
    const Entry &a = entries_.at(first), &b = entries_.at(second);
    const int from = out.count;
    origin_ = first_pose.position;
    if (a.shape.vertices.empty() || b.shape.vertices.empty()) {
      const bool turned = !a.shape.vertices.empty();
      round_and_polyhedron(turned ? b : a, turned ? second_pose : first_pose, turned ? a : b,
                           turned ? first_pose : second_pose, margin, out);
      if (turned) turn(out, from);
    } else {
      place(a, first_pose, a_);
      place(b, second_pose, b_);
      polyhedra(margin, out);
    }
    for (int k = from; k < out.count; ++k) {
      out.point[k].on_first += origin_;
      out.point[k].on_second += origin_;
    }
  }

 private:
  struct Entry {
    ShapeKind kind;
    double radius = 0, half = 0;
    Polyhedron shape;
  };

  void place(const Entry& entry, const Pose& pose, Placed& to) {
    to.shape = &entry.shape;
    to.rotation = pose.rotation;
    detail::place(entry.shape, pose, origin_, to.now);
  }

  static void turn(NearPoints& out, int from) {
    for (int k = from; k < out.count; ++k) {
      std::swap(out.point[k].on_first, out.point[k].on_second);
      out.point[k].normal = -out.point[k].normal;
    }
  }

  void polyhedra(double margin, NearPoints& out) {
    const double size = std::min(a_.now.size, b_.now.size), tie = kTie * size;
    const double rounding = kRounding * size;
    const FaceAxis A = best_face(a_, b_, rounding);
    if (A.separation >= margin) return;
    const FaceAxis B = best_face(b_, a_, rounding);
    if (B.separation >= margin) return;
    const EdgeAxis E = best_edges(a_, b_, rounding);
    if (E.separation >= margin) return;
    const double best = std::max(A.separation, B.separation);
    if (E.separation > best + tie) {
      const int before = out.count;
      crossing_edges(E, tie, margin, out);
      // One point leaves bodies free to turn about it: what may close meanwhile is open now.
      if (out.count > before) over_face(A, B, tie, margin, size, 0, out);
      return;
    }
    const Vector3d &nA = a_.face(A.face).normal, &nB = b_.face(B.face).normal;
    if (std::abs(A.separation - B.separation) < tie && -nA.dot(nB) < kParallel)
      return edge_along_edge((nA - nB).normalized(), rounding, margin, out);
    over_face(A, B, tie, margin, size, -kInfinity, out);
  }

  // The first body's face unless the second one's is clearly better, so that touching faces keep
  // their reference.
  void over_face(const FaceAxis& A, const FaceAxis& B, double tie, double margin, double size,
                 double least, NearPoints& out) {
    if (A.separation >= B.separation - tie) {
      const int from = out.count;
      clip(a_, A.face, b_, least, margin, size, 0, out);
      turn(out, from);
    } else {
      clip(b_, B.face, a_, least, margin, size, 1 << 15, out);
    }
  }

  // Among the faces farthest along -n, the one most nearly perpendicular to n. A face that lies
  // more against n may still end above the lowest corner.
  int lowest_face(const Placed& other, const Vector3d& n, double same) {
    double lowest = kInfinity;
    height_.clear();
    for (const Vector3d& v : other.now.vertices) {
      height_.push_back(n.dot(v));
      lowest = std::min(lowest, height_.back());
    }
    int best = -1;
    double cosine = 0;
    for (int f = 0; f < static_cast<int>(other.now.faces.size()); ++f) {
      const std::vector<int>& loop = other.loop(f);
      if (std::none_of(loop.begin(), loop.end(),
                       [&](int v) { return height_[at(v)] < lowest + same; }))
        continue;
      const double c = other.face(f).normal.dot(n);
      if (best >= 0 && !(c < cosine - kRounding)) continue;
      best = f;
      cosine = c;
    }
    return best;
  }

  // Points on faces of `other` over the reference face; on_first of a result is on `other`, its
  // normal is that of the reference face.
  void clip(const Placed& reference, int face, const Placed& other, double least, double margin,
            double size, int mark, NearPoints& out) {
    const Vector3d& n = reference.face(face).normal;
    const double offset = reference.face(face).offset;
    const double same = kSame * size;
    const int opposite = lowest_face(other, n, same);
    polygon_.clear();
    // Loops run the other way round seen from the reference face; either way serves.
    for (int k = 0; k < other.loop_size(opposite); ++k) {
      const int v = other.loop(opposite)[at(k)];
      polygon_.push_back({other.vertex(v), v & 0x7ff, k});
    }
    for (int k = 0; k < reference.loop_size(face) && !polygon_.empty(); ++k)
      clip_to(reference.inward(face, k), reference.corner(face, k), k, same);
    merge(same);
    for (const Corner& c : polygon_) {
      const double gap = n.dot(c.point) - offset;
      if (gap > least && gap < margin)
        out.add(c.point, c.point - gap * n, n, gap, mark | c.feature);
    }
  }

  // Keeps inward . (x - on_plane) >= 0. Signs and cut parameters are of the same two numbers, so
  // that a cut lies between the ends of its edge however flat the edge lies in the plane. A cut
  // within `same` of a corner takes over its feature: faces of equal size do not flicker.
  void clip_to(const Vector3d& inward, const Vector3d& on_plane, int plane, double same) {
    clipped_.clear();
    const std::size_t n = polygon_.size();
    for (std::size_t k = 0; k < n; ++k) {
      const Corner &c = polygon_[k], &next = polygon_[k + 1 == n ? 0 : k + 1];
      const double d = inward.dot(c.point - on_plane), e = inward.dot(next.point - on_plane);
      const bool in = d >= 0, next_in = e >= 0;
      if (in) clipped_.push_back(c);
      if (in == next_in) continue;
      const Vector3d point = c.point + d / (d - e) * (next.point - c.point);
      int feature = 2048 + (c.edge * 181 + plane) % 30000;
      if ((point - c.point).squaredNorm() < same * same) feature = c.feature;
      if ((point - next.point).squaredNorm() < same * same) feature = next.feature;
      // Going out, the side plane follows; coming in, the rest of the edge.
      clipped_.push_back({point, feature, in ? 128 + plane : c.edge});
    }
    polygon_.swap(clipped_);
  }

  // Leaves out corners within `same` of another one or of the line between their neighbours: what
  // is left spans the polygon up to that, and no point is moved.
  void merge(double same) {
    const auto spare = [&](std::size_t k) {
      const std::size_t n = polygon_.size();
      const Vector3d p = polygon_[k == 0 ? n - 1 : k - 1].point - polygon_[k].point;
      const Vector3d q = polygon_[k + 1 == n ? 0 : k + 1].point - polygon_[k].point;
      const double pp = p.squaredNorm(), qq = q.squaredNorm(), s2 = same * same;
      if (pp < s2 || qq < s2) return true;
      return p.dot(q) < 0 && p.cross(q).squaredNorm() < s2 * (p - q).squaredNorm();
    };
    for (std::size_t k = polygon_.size(); k-- > 0 && polygon_.size() > 1;)
      if (spare(k)) polygon_.erase(polygon_.begin() + static_cast<std::ptrdiff_t>(k));
  }

  // Segments that pass each other beside their ends are as far apart as their nearest points, which
  // is farther than along the product of their directions.
  void crossing_edges(const EdgeAxis& E, double tie, double margin, NearPoints& out) {
    const Polyhedron::Edge& e = a_.shape->edges[at(E.first)];
    const Polyhedron::Edge& g = b_.shape->edges[at(E.second)];
    Vector3d p, q;
    nearest(a_.vertex(e.from), a_.vertex(e.to) - a_.vertex(e.from), b_.vertex(g.from),
            b_.vertex(g.to) - b_.vertex(g.from), p, q);
    Vector3d n = -E.normal;
    double gap = E.separation;
    const Vector3d apart = p - q;
    if (gap > 0 && (apart - gap * n).norm() > tie) {
      gap = apart.norm();
      n = apart / gap;
    }
    if (gap < margin) out.add(p, q, n, gap, 0x7f10 + (E.first * 251 + E.second) % 0xef);
  }

  // The edge of `a` that is farthest in direction m: from the farthest vertex along the edge that
  // lies most across m. A vertex alone (from == to) where none does.
  static Polyhedron::Edge farthest(const Placed& a, const Vector3d& m, double rounding) {
    int v = 0;
    for (int k = 1; k < static_cast<int>(a.now.vertices.size()); ++k)
      if (m.dot(a.vertex(k)) > m.dot(a.vertex(v)) + rounding) v = k;
    Polyhedron::Edge best{v, v, -1, -1};
    double slope = kAcross;
    for (const Polyhedron::Edge& e : a.shape->edges) {
      if (e.from != v && e.to != v) continue;
      const Vector3d u = a.vertex(e.to) - a.vertex(e.from);
      const double s = std::abs(m.dot(u)) / u.norm();
      if (s >= slope - kRounding) continue;
      slope = s;
      best = e;
    }
    return best;
  }

  // m points from the first body to the second.
  void edge_along_edge(const Vector3d& m, double rounding, double margin, NearPoints& out) {
    const Polyhedron::Edge e = farthest(a_, m, rounding), g = farthest(b_, -m, rounding);
    const Vector3d p = a_.vertex(e.from), u = a_.vertex(e.to) - p;
    const Vector3d q = b_.vertex(g.from), v = b_.vertex(g.to) - q;
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
    // Edges that cross seen along m touch where they do; an angle in a plane with m opens a gap.
    if (std::abs(m.dot(u.cross(v))) > 1e-3 * std::sqrt(uu * vv)) {
      Vector3d x, y;
      nearest(p, u, q, v, x, y);
      return add(x, y, 0x7f01);
    }
    // Ends of the overlap of the edges, by their places along the first.
    const double from = std::max(0.0, std::min(u.dot(q - p), u.dot(q + v - p)) / uu);
    const double to = std::min(1.0, std::max(u.dot(q - p), u.dot(q + v - p)) / uu);
    if (from > to) {  // one beyond the other: end to end
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

  // The point of the polyhedron b_ nearest to c, the outward direction there, and the distance
  // (negative inside).
  double nearest_point(const Vector3d& c, Vector3d& point, Vector3d& normal) const {
    int best = 0;
    double height = -kInfinity;
    for (int f = 0; f < static_cast<int>(b_.now.faces.size()); ++f) {
      const double h = b_.face(f).normal.dot(c) - b_.face(f).offset;
      if (h > height) {
        height = h;
        best = f;
      }
    }
    normal = b_.face(best).normal;
    point = c - height * normal;
    if (height <= 0) return height;
    bool over = true;
    for (int k = 0; k < b_.loop_size(best); ++k) {
      const Vector3d& p = b_.corner(best, k);
      over = over && normal.cross(b_.corner(best, k + 1) - p).dot(c - p) >= 0;
    }
    if (over) return height;
    double least = kInfinity;
    for (const Polyhedron::Edge& e : b_.shape->edges) {
      const Vector3d &p = b_.vertex(e.from), u = b_.vertex(e.to) - p;
      const Vector3d x = p + std::clamp(u.dot(c - p) / u.squaredNorm(), 0.0, 1.0) * u;
      const double distance = (c - x).norm();
      if (distance < least) {
        least = distance;
        point = x;
      }
    }
    // On the surface to rounding the difference has no direction.
    if (least > kRounding * b_.now.size) normal = (c - point) / least;
    return least;
  }

  // Both ends of a capsule as balls, and where its axis passes an edge between them.
  void round_and_polyhedron(const Entry& round, const Pose& round_pose, const Entry& polyhedron,
                            const Pose& pose, double margin, NearPoints& out) {
    place(polyhedron, pose, b_);
    const Vector3d middle = round_pose.position - origin_;
    const Vector3d half = round.half > 0 ? Vector3d(round.half * round_pose.rotation.col(2))
                                         : Vector3d(Vector3d::Zero());
    for (int end = 0; end < (round.half > 0 ? 2 : 1); ++end) {
      const Vector3d c = end == 0 ? Vector3d(middle - half) : Vector3d(middle + half);
      Vector3d p, n;
      const double gap = nearest_point(c, p, n) - round.radius;
      if (gap < margin) out.add(c - round.radius * n, p, n, gap, end);
    }
    if (!(round.half > 0)) return;
    const Vector3d from = middle - half, u = 2 * half;
    for (std::size_t k = 0; k < b_.shape->edges.size(); ++k) {
      const Polyhedron::Edge& e = b_.shape->edges[k];
      const Vector3d &q = b_.vertex(e.from), v = b_.vertex(e.to) - q;
      if (u.cross(v).squaredNorm() < 1e-6 * u.squaredNorm() * v.squaredNorm()) continue;
      Vector3d x, y;
      nearest(from, u, q, v, x, y);
      const double s = u.dot(x - from) / u.squaredNorm(), t = v.dot(y - q) / v.squaredNorm();
      if (s <= 0 || s >= 1 || t <= 0 || t >= 1) continue;
      Vector3d n = x - y;
      const double distance = n.norm();
      if (!(distance > 0) || distance - round.radius >= margin) continue;
      n /= distance;
      // Nearest to the edge from outside: between the normals of its faces, or along one of them
      // where the capsule lies flat on a face and reaches beyond it.
      const double slack = kFlat * v.norm();
      const double left = n.dot(b_.face(e.left).normal.cross(v));
      const double right = n.dot(b_.face(e.right).normal.cross(v));
      if (std::min(left, right) > slack || std::max(left, right) < -slack) continue;
      if (n.dot(b_.face(e.left).normal + b_.face(e.right).normal) <= 0) continue;
      out.add(x - round.radius * n, y, n, distance - round.radius, 2 + static_cast<int>(k % 60000));
    }
  }

  std::unordered_map<int, Entry> entries_;
  Vector3d origin_ = Vector3d::Zero();
  Placed a_, b_;
  std::vector<Corner> polygon_, clipped_;
  std::vector<double> height_;
};

}  // namespace

std::unique_ptr<PairCollision> make_polyhedra() { return std::make_unique<Polyhedra>(); }

}  // namespace tether::contact
