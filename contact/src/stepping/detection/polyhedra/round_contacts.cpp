// Tether: balls, capsules and points on polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/round_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "stepping/detection/polyhedra/edge_contacts.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr double kFlat = 1e-9;  // radian: an axis within this angle lies along a face

// Finds the point of the surface nearest to c and the outward normal there. Returns the distance,
// negative inside.
double nearest_point(const Placed& b, const Vector3d& c, Vector3d& point, Vector3d& normal) {
  const auto is_open = [&](int f) { return !b.shape->faces[at(f)].open.empty(); };
  // Inside, the way out leads through a face that is open.
  int best = 0;
  double height = -std::numeric_limits<double>::infinity();
  for (int f = 0; f < static_cast<int>(b.now.faces.size()); ++f) {
    const double h = b.face(f).normal.dot(c) - b.face(f).offset;
    if (h > height && (h > 0 || is_open(f))) {
      height = h;
      best = f;
    }
  }
  if (!is_open(best) && height < 0) return std::numeric_limits<double>::infinity();
  normal = b.face(best).normal;
  point = c - height * normal;
  if (height <= 0) return height;
  bool over = true;
  for (int k = 0; k < b.loop_size(best); ++k) {
    const Vector3d& p = b.corner(best, k);
    over = over && normal.cross(b.corner(best, k + 1) - p).dot(c - p) >= 0;
  }
  if (over) return height;
  double least = std::numeric_limits<double>::infinity();
  for (const Polyhedron::Edge& e : b.shape->edges) {
    const Vector3d &p = b.vertex(e.from), u = b.vertex(e.to) - p;
    const Vector3d x = p + std::clamp(u.dot(c - p) / u.squaredNorm(), 0.0, 1.0) * u;
    const double distance = (c - x).norm();
    if (distance < least) {
      least = distance;
      point = x;
    }
  }
  // If c is on the surface up to rounding the difference has no direction: the normal of the face
  // stays.
  if (least > kEqual * b.now.size) normal = (c - point) / least;
  return least;
}

}  // namespace

void points_on_polyhedron(const std::vector<Vector3d>& points, const Pose& pose, const Placed& b,
                          double margin, NearPoints& out) {
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vector3d c = pose.position + pose.rotation * points[k];
    Vector3d p, n;
    const double gap = nearest_point(b, c, p, n);
    if (gap < margin) out.add(c, p, n, gap, static_cast<int>(k));
  }
}

void round_on_polyhedron(const Round& round, const Placed& b, double margin, NearPoints& out) {
  const Vector3d &middle = round.middle, &half = round.half;
  for (int end = 0; end < (round.capsule ? 2 : 1); ++end) {
    const Vector3d c = end == 0 ? Vector3d(middle - half) : Vector3d(middle + half);
    Vector3d p, n;
    const double gap = nearest_point(b, c, p, n) - round.radius;
    if (gap < margin) out.add(c - round.radius * n, p, n, gap, end);
  }
  if (!round.capsule) return;
  const Vector3d from = middle - half, u = 2 * half;
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
    if (!(distance > 0) || distance - round.radius >= margin) continue;
    n /= distance;
    // The edge is nearest if the direction to the axis lies between the normals of its faces. It
    // may coincide with one of them where the capsule lies flat on a face and reaches beyond it.
    const double slack = kFlat * v.norm();
    const double left = n.dot(b.face(e.left).normal.cross(v));
    const double right = n.dot(b.face(e.right).normal.cross(v));
    if (std::min(left, right) > slack || std::max(left, right) < -slack) continue;
    if (n.dot(b.face(e.left).normal + b.face(e.right).normal) <= 0) continue;
    out.add(x - round.radius * n, y, n, distance - round.radius,
            kCapsuleOnEdge + static_cast<int>(k % 60000));
  }
}

}  // namespace tether::contact::detail
