// Tether: convex shapes on a mesh of triangles. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/mesh/mesh_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// Identity of a contact, made of its features, which is the same in every step.
std::uint64_t key_of(std::uint64_t kind, int a, int b) {
  std::uint64_t x = kind;
  for (const int each : {a, b}) {
    x = (x + static_cast<std::uint64_t>(each) + 1) * 0x9e3779b97f4a7c15;
    x ^= x >> 29;
  }
  return x * 0xbf58476d1ce4e5b9;
}
enum Kind : std::uint64_t { kOverFace = 1, kOnEdge, kOnCorner, kTopEdge, kTopCorner };

}  // namespace

struct MeshContacts::Body {
  const Shape& shape;
  Pose pose;
  ConvexShape convex;
  double margin;
};

MeshContacts::MeshContacts(const Shape& mesh) : mesh_(mesh.points, mesh.triangles), tree_(mesh_) {
  corners_.resize(3);
}

void MeshContacts::collide(const Shape& a, const Pose& A, const Pose& mesh, double margin,
                           NearPoints& out) {
  Pose pose;
  pose.rotation = mesh.rotation.transpose() * A.rotation;
  const Vector3d origin = mesh.rotation.transpose() * (A.position - mesh.position);
  const Body body{a, pose, ConvexShape(a, pose, Vector3d::Zero()), margin};
  Vector3d low, high;
  for (int k = 0; k < 3; ++k) {
    const double round = body.convex.round + margin;
    high[k] = body.convex.farthest(Vector3d::Unit(k))[k] + round;
    low[k] = body.convex.farthest(-Vector3d::Unit(k))[k] - round;
  }
  const int from = out.count;
  keys_.clear();
  features_.clear();
  tree_.near({origin + low, origin + high}, [&](int t) {
    const TriangleMesh::Triangle& triangle = mesh_[t];
    Near near{triangle, {}, 0};
    for (int k = 0; k < 3; ++k) near.corner[at(k)] = mesh_.point(triangle.corner[at(k)]) - origin;
    for (int k = 0; k < 3; ++k)
      near.longest =
          std::max(near.longest, (near.corner[at((k + 1) % 3)] - near.corner[at(k)]).norm());
    touch(body, near, out);
  });
  for (int k = from; k < out.count; ++k) {
    NearPoint& p = out.point[at(k)];
    p.on_first = mesh.position + mesh.rotation * (origin + p.on_first);
    p.on_second = mesh.position + mesh.rotation * (origin + p.on_second);
    p.normal = mesh.rotation * p.normal;
  }
}

// Adds the contacts of one triangle (detection, section 4). The contacts of the body with the plane
// of the face count if the body is above it, or if the face is the nearest way out. Edges and
// corners count where the surface is sharp.
void MeshContacts::touch(const Body& body, const Near& near, NearPoints& out) {
  const Vector3d &n = near.triangle.normal, &p = near.corner[0];
  if (!(n.dot(p) < 0)) return;  // the middle of the body is behind the triangle
  const double thickness = body.convex.thickness;
  const double low = n.dot(body.convex.farthest(-n) - p) - body.convex.round;
  if (!(low < body.margin)) return;
  plane_.count = 0;
  form(body.shape.kind).on_plane(body.shape, body.pose, p, n, body.margin, plane_);
  int over = 0;
  bool lowest = false;
  for (int j = 0; j < plane_.count; ++j) {
    const NearPoint& q = plane_.point[at(j)];
    bool inside = true;
    for (int k = 0; k < 3 && inside; ++k) {
      const Vector3d& c = near.corner[at(k)];
      const Vector3d along = near.corner[at((k + 1) % 3)] - c;
      // A point so near the border is inside.
      inside = n.cross(along).dot(q.on_second - c) >= -1e-10 * near.longest * along.norm();
    }
    if (!inside) continue;
    lowest = lowest || q.gap <= low + kUpright * thickness;
    plane_.point[at(over++)] = q;
  }
  // In such depths every face is a way out.
  const bool sharp = near.triangle.sharp(), shallow = low >= -kNear * thickness;
  bool face = shallow || !sharp;
  if (sharp && !(lowest && shallow) && !separate(body, near, face, out)) return;
  for (int j = 0; j < over; ++j) {
    const NearPoint& q = plane_.point[at(j)];
    if (q.gap >= 0 || face)
      add(q.on_first, n, q.gap, key_of(kOverFace, near.triangle.patch, q.feature), out);
  }
  if (sharp && face) cut_edges(body, near, low, out);
}

// Adds contacts with sharp edges and corners. Sets `face` if the nearest way out is across the
// face. Returns false if the body is farther away than the margin.
bool MeshContacts::separate(const Body& body, const Near& near, bool& face, NearPoints& out) {
  std::copy(near.corner.begin(), near.corner.end(), corners_.begin());
  const ConvexShape triangle(corners_, body.convex.thickness);
  Separation apart;
  if (!find_separation(body.convex, triangle, body.margin, apart)) return false;
  if ((apart.normal - near.triangle.normal).norm() < kNear) {
    face = true;
    return true;
  }
  Flat s, top;
  std::uint64_t part = 0;
  if (!top_of(near, apart.normal, top, part)) return true;
  edges_.count = 0;
  const Vector3d origin = Vector3d::Zero();
  const ConvexPair pair{body.convex, triangle, origin, apart, body.margin, edges_};
  body.convex.flat(-apart.normal, pair.height(), s);
  manifold(pair, s, top);
  for (int k = 0; k < edges_.count; ++k) {
    const NearPoint& q = edges_.point[at(k)];
    add(q.on_first, apart.normal, q.gap, part + q.feature, out);
  }
  return true;
}

// Finds the feature of the triangle that faces n. Returns true if it is sharp and the surface
// around it stays below the plane across n, so that no other triangle is nearer.
bool MeshContacts::top_of(const Near& near, const Vector3d& n, Flat& top,
                          std::uint64_t& part) const {
  const TriangleMesh::Triangle& t = near.triangle;
  std::array<double, 3> height{};
  for (int k = 0; k < 3; ++k) height[at(k)] = n.dot(near.corner[at(k)]);
  const double least = *std::max_element(height.begin(), height.end()) - kNear * near.longest;
  for (int k = 0; k < 3; ++k)
    if (height[at(k)] >= least) top.add(near.corner[at(k)], k);
  if (top.count == 3) return false;
  if (top.count == 1) {
    const int k = top.id[0], corner = t.corner[at(k)];
    part = key_of(kTopCorner, corner, 0);
    return t.sharp_corner[at(k)] != 0 && mesh_.is_top(corner, n);
  }
  const int k = top.id[0] == 0 && top.id[1] == 2 ? 2 : top.id[0];
  part = key_of(kTopEdge, t.edge[at(k)], 0);
  if (t.sharp_edge[at(k)] == 0) return false;
  if (t.apex[at(k)] < 0) return true;
  const Vector3d way = mesh_.point(t.apex[at(k)]) - mesh_.point(t.corner[at(k)]);
  return n.dot(way) <= kNear * way.norm();
}

// Adds the points at which a face or a line of the body passes over a sharp edge or corner of the
// triangle. Cuts at other edges lie within the flat surface and are no contacts.
void MeshContacts::cut_edges(const Body& body, const Near& near, double low, NearPoints& out) {
  const TriangleMesh::Triangle& t = near.triangle;
  const double height = std::min(body.margin - low, kHigh * body.convex.thickness);
  Flat flat;
  body.convex.flat(-t.normal, height, flat);
  if (flat.count < 2) return;
  for (int k = 0; k < 3 && flat.count > 0; ++k) {
    const Vector3d& from = near.corner[at(k)];
    clip(flat, t.normal.cross(near.corner[at((k + 1) % 3)] - from), from, k,
         [&](std::size_t j) { return flat.id[j]; });
  }
  for (int j = 0; j < flat.count; ++j) {
    const Vector3d& x = flat.point[at(j)];
    const int edge = flat.edge[at(j)];
    if (edge < 0) continue;
    const double above = t.normal.dot(x - near.corner[0]);
    const double gap = above - body.convex.round;
    if (!(gap < body.margin)) continue;
    const Vector3d foot = x - above * t.normal;
    std::uint64_t key = 0;
    if (t.sharp_edge[at(edge)] != 0) key = key_of(kOnEdge, t.edge[at(edge)], flat.id[at(j)]);
    for (const int k : {edge, (edge + 1) % 3})
      if ((foot - near.corner[at(k)]).norm() <= kUpright * near.longest)
        key = t.sharp_corner[at(k)] != 0 ? key_of(kOnCorner, t.corner[at(k)], 0) : 0;
    if (key != 0)
      add(x - body.convex.round * t.normal, t.normal, gap,
          key + 0x9e3779b97f4a7c15 * static_cast<std::uint64_t>(t.patch), out);
  }
}

void MeshContacts::add(const Vector3d& on_body, const Vector3d& n, double gap, std::uint64_t key,
                       NearPoints& out) {
  if (std::find(keys_.begin(), keys_.end(), key) != keys_.end()) return;
  keys_.push_back(key);
  int feature = static_cast<int>(key >> 48);
  while (std::find(features_.begin(), features_.end(), feature) != features_.end())
    feature = (feature + 1) & 0xffff;
  features_.push_back(feature);
  out.add(on_body, on_body - gap * n, n, gap, feature);
}

}  // namespace tether::contact::detail
