// Tether: seams between the convex parts of a body. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/seams.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "stepping/detection/clip.hpp"
#include "stepping/detection/polyhedra/polyhedra.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

double extent(const Polyhedron& p) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& v : p.vertices) box.extend(v);
  return box.sizes().maxCoeff();
}

// The convex pieces of a polygon in the plane across n that are not in a convex polygon `over`,
// which runs clockwise about n.
std::vector<Polygon> without(const Polygon& whole, const Polygon& over, const Vector3d& n,
                             double same) {
  std::vector<Polygon> left;
  Polygon polygon = whole, outside, inside;
  for (std::size_t k = 0; k < over.size(); ++k) {
    const Vector3d inward = (over[(k + 1) % over.size()] - over[k]).cross(n).normalized();
    split_polygon(polygon, inward, inward.dot(over[k]), same, outside, inside);
    const auto is_wide = [&](const Polygon& p, double side) {
      return std::any_of(p.begin(), p.end(),
                         [&](const Vector3d& x) { return side * inward.dot(x - over[k]) > same; });
    };
    if (!is_wide(inside, 1)) return {whole};  // they have no area in common
    if (is_wide(outside, -1)) left.push_back(outside);
    polygon.swap(inside);
  }
  return left;
}

Polygon corners_of(const Polyhedron& a, const Polyhedron::Face::Piece& piece) {
  Polygon out;
  for (const int v : piece.loop) out.push_back(a.vertices[at(v)]);
  return out;
}

Polyhedron::Face::Piece piece_of(Polyhedron& a, const Polygon& corners) {
  Polyhedron::Face::Piece out;
  for (const Vector3d& x : corners) {
    const auto known = std::find(a.vertices.begin(), a.vertices.end(), x);
    out.loop.push_back(static_cast<int>(known - a.vertices.begin()));
    if (known == a.vertices.end()) a.vertices.push_back(x);
  }
  out.seam.assign(out.loop.size(), 0);
  return out;
}

bool is_within(const Polygon& polygon, const Vector3d& n, const Vector3d& x, double same) {
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vector3d along = polygon[(k + 1) % polygon.size()] - polygon[k];
    if (n.cross(along).normalized().dot(x - polygon[k]) < -same) return false;
  }
  return true;
}

// Cuts the edges of a piece of `a` at the corners of the other piece that are on them, and marks
// those along it.
void mark_edges(Polyhedron& a, Polyhedron::Face::Piece& piece, const Vector3d& n,
                const Polygon& other, double same) {
  const Polygon mine = corners_of(a, piece);
  Polygon corners;
  std::vector<char> seam;
  for (std::size_t k = 0; k < mine.size(); ++k) {
    const Vector3d &p = mine[k], along = mine[(k + 1) % mine.size()] - p;
    const double length = along.norm();
    std::vector<double> at_ends{0, length};
    for (const Vector3d& x : other) {
      const double s = along.dot(x - p) / length;
      if (s > same && s < length - same && (x - p - s / length * along).norm() <= same)
        at_ends.push_back(s);
    }
    std::sort(at_ends.begin(), at_ends.end());
    for (std::size_t e = 0; e + 1 < at_ends.size(); ++e) {
      const double middle = (at_ends[e] + at_ends[e + 1]) / 2;
      corners.push_back(p + at_ends[e] / length * along);
      seam.push_back(piece.seam[k] != 0 || is_within(other, n, p + middle / length * along, same));
    }
  }
  piece = piece_of(a, corners);
  piece.seam = std::move(seam);
}

// Marks the edges of the open pieces of `a` beyond which an open piece of b goes on in the plane.
void mark_seams(Polyhedron& a, const Pose& A, const Polyhedron& b, const Pose& B) {
  const double same = kNear * std::max(extent(a), extent(b));
  const Eigen::Matrix3d R = A.rotation.transpose() * B.rotation;
  const Vector3d move = A.rotation.transpose() * (B.position - A.position);
  for (Polyhedron::Face& f : a.faces)
    for (const Polyhedron::Face& g : b.faces)
      for (const Polyhedron::Face::Piece& other : g.open) {
        Polygon polygon = corners_of(b, other);
        for (Vector3d& x : polygon) x = move + R * x;
        if (f.normal.dot(R * g.normal) > 0 &&
            std::all_of(polygon.begin(), polygon.end(), [&](const Vector3d& x) {
              return std::abs(f.normal.dot(x) - f.offset) <= same;
            }))
          for (Polyhedron::Face::Piece& piece : f.open)
            mark_edges(a, piece, f.normal, polygon, same);
      }
}

// Takes from the open pieces of `a` what a face of b lies against. Returns whether anything was.
bool cover(Polyhedron& a, const Pose& A, const Polyhedron& b, const Pose& B) {
  const double same = kNear * std::max(extent(a), extent(b));
  std::vector<Vector3d> of_b;  // in the axes of a
  for (const Vector3d& v : b.vertices)
    of_b.push_back(A.rotation.transpose() * (B.position + B.rotation * v - A.position));
  bool any = false;
  for (Polyhedron::Face& f : a.faces) {
    for (const Polyhedron::Face& g : b.faces) {
      if (f.normal.dot(A.rotation.transpose() * B.rotation * g.normal) > 0 ||
          std::any_of(g.loop.begin(), g.loop.end(), [&](int v) {
            return !(std::abs(f.normal.dot(of_b[at(v)]) - f.offset) <= same);
          }))
        continue;
      Polygon over;
      for (const int v : g.loop) over.push_back(of_b[at(v)]);
      std::vector<Polyhedron::Face::Piece> open;
      bool covers = false;
      for (const Polyhedron::Face::Piece& piece : f.open) {
        const Polygon polygon = corners_of(a, piece);
        const std::vector<Polygon> left = without(polygon, over, f.normal, same);
        if (left.size() == 1 && left[0] == polygon) {
          open.push_back(piece);
          continue;
        }
        covers = true;
        for (const Polygon& each : left) open.push_back(piece_of(a, each));
      }
      if (covers) f.open = std::move(open);
      any = any || covers;
    }
  }
  return any;
}

// Takes from the open pieces of each part of a body what other parts lie against, and marks the
// edges beyond which these go on in the plane. Returns for each part those that touch its faces.
std::vector<std::vector<int>> find_seams(std::vector<Polyhedron>& parts,
                                         const std::vector<Pose>& poses) {
  const std::vector<Polyhedron> whole = parts;
  std::vector<std::vector<int>> touching(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::size_t j = 0; j < parts.size(); ++j)
      if (i != j && cover(parts[i], poses[i], whole[j], poses[j]))
        touching[i].push_back(static_cast<int>(j));
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (const int j : touching[i]) mark_seams(parts[i], poses[i], parts[at(j)], poses[at(j)]);
  return touching;
}

// Whether b has the point x, and reaches above the plane through it across n.
bool rises_above(const Polyhedron& b, const Pose& B, const Vector3d& x, const Vector3d& n) {
  const Vector3d p = B.rotation.transpose() * (x - B.position), m = B.rotation.transpose() * n;
  const double same = kNear * extent(b);
  for (const Polyhedron::Face& f : b.faces)
    if (f.normal.dot(p) - f.offset > same) return false;
  return std::any_of(b.vertices.begin(), b.vertices.end(),
                     [&](const Vector3d& v) { return m.dot(v - p) > kUpright * (v - p).norm(); });
}

// x, or where it is outside of `a` a point of `a` near to it.
Vector3d into(const Polyhedron& a, const Pose& A, const Vector3d& x) {
  Vector3d p = A.rotation.transpose() * (x - A.position);
  for (const Polyhedron::Face& f : a.faces)
    p -= std::max(0.0, f.normal.dot(p) - f.offset) * f.normal;
  return A.position + A.rotation * p;
}

// Whether x lies on an open piece of a face of `a` whose normal is n, up to an angle in radian.
bool is_on_open_piece(const Polyhedron& a, const Pose& A, const Vector3d& x, const Vector3d& n,
                      double angle) {
  const Vector3d p = A.rotation.transpose() * (x - A.position), m = A.rotation.transpose() * n;
  const double same = kNear * extent(a);
  for (const Polyhedron::Face& f : a.faces) {
    if (!(f.normal.dot(m) > 1 - 0.5 * angle * angle)) continue;
    for (const Polyhedron::Face::Piece& piece : f.open)
      if (is_within(corners_of(a, piece), f.normal, p, same)) return true;
  }
  return false;
}

}  // namespace

bool Seam::at(const Vector3d& x, const Vector3d& n) const {
  return parts->is_seam(part, x, n, kTie);
}

void Parts::join(const std::vector<int>& numbers, std::vector<Polyhedron> shapes,
                 const std::vector<Pose>& on_body) {
  const std::vector<std::vector<int>> beside = find_seams(shapes, on_body);
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    if (beside[i].empty()) continue;
    touching.resize(polyhedron.size());
    for (const int j : beside[i])
      touching[linalg::at(numbers[i])].push_back(numbers[linalg::at(j)]);
    polyhedron[linalg::at(numbers[i])] = std::move(shapes[i]);
  }
}

bool Parts::is_seam(int k, const Vector3d& near, const Vector3d& n, double angle) const {
  if (!has_seams(k)) return false;
  const std::vector<int>& others = touching[linalg::at(k)];
  const Polyhedron& a = polyhedron[linalg::at(k)];
  const Pose& A = pose[linalg::at(k)];
  // The point is beside an edge that a round shape overlaps.
  const Vector3d x = into(a, A, near);
  return std::any_of(others.begin(), others.end(),
                     [&](int j) {
                       return rises_above(polyhedron[linalg::at(j)], pose[linalg::at(j)], x, n);
                     }) &&
         !is_on_open_piece(a, A, x, n, angle);
}

bool Parts::goes_on(int k, const Vector3d& x, const Vector3d& n) const {
  return has_seams(k) &&
         std::any_of(touching[linalg::at(k)].begin(), touching[linalg::at(k)].end(), [&](int j) {
           return is_on_open_piece(polyhedron[linalg::at(j)], pose[linalg::at(j)], x, n, kTie);
         });
}

}  // namespace tether::contact::detail

namespace tether::contact {

std::vector<std::vector<OpenFace>> open_faces(const std::vector<Shape>& shapes) {
  std::vector<std::size_t> number;  // of the boxes and hulls
  std::vector<detail::Polyhedron> parts;
  std::vector<Pose> poses;
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    if (!detail::is_polyhedron(shapes[k].kind)) continue;
    number.push_back(k);
    parts.push_back(detail::make_polyhedron(shapes[k]));
    poses.push_back({shapes[k].position, shapes[k].orientation.toRotationMatrix()});
  }
  const std::vector<std::vector<int>> touching = detail::find_seams(parts, poses);
  std::vector<std::vector<OpenFace>> out(shapes.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (touching[i].empty()) continue;
    for (const detail::Polyhedron::Face& face : parts[i].faces)
      for (const detail::Polyhedron::Face::Piece& piece : face.open) {
        OpenFace open{poses[i].rotation * face.normal, {}};
        for (const int v : piece.loop)
          open.corners.push_back(poses[i].position +
                                 poses[i].rotation * parts[i].vertices[linalg::at(v)]);
        out[number[i]].push_back(std::move(open));
      }
  }
  return out;
}

}  // namespace tether::contact
