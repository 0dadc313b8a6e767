// Tether: collision of polyhedra. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/polyhedra.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "collision/edge_contacts.hpp"
#include "collision/face_clipping.hpp"
#include "collision/round_contacts.hpp"
#include "collision/separating_axes.hpp"

namespace tether::contact {

using detail::EdgeAxis;
using detail::FaceAxis;
using detail::Placed;
using detail::Polyhedron;
using Eigen::Vector3d;

namespace {

// Faces more oblique to each other than this have an edge contact between them.
constexpr double kParallel = 0.99875;  // cos 0.05
// Part of the smaller thickness: separations between which faces are preferred.
constexpr double kTie = 1e-4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Polyhedra final : public PairCollision {
 public:
  bool serves(ShapeKind a, ShapeKind b) const override {
    const auto polyhedron = [](ShapeKind k) {
      return k == ShapeKind::box || k == ShapeKind::convex;
    };
    const auto round = [](ShapeKind k) {
      return k == ShapeKind::sphere || k == ShapeKind::capsule || k == ShapeKind::points;
    };
    return (polyhedron(a) && (polyhedron(b) || round(b))) || (round(a) && polyhedron(b));
  }

  void add(int surface, const Shape& shape) override {
    Entry entry;
    entry.kind = shape.kind;
    entry.radius = shape.radius;
    entry.half = shape.kind == ShapeKind::capsule ? 0.5 * shape.length : 0;
    if (shape.kind == ShapeKind::points) entry.points = shape.points;
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
      place(turned ? a : b, turned ? first_pose : second_pose, b_);
      const Entry& other = turned ? b : a;
      Pose pose = turned ? second_pose : first_pose;
      pose.position -= origin_;
      if (other.kind == ShapeKind::points)
        points_on_polyhedron(other.points, pose, b_, margin, out);
      else
        round_on_polyhedron(placed(other, pose), b_, margin, out);
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
    std::vector<Vector3d> points;
  };

  void place(const Entry& entry, const Pose& pose, Placed& to) {
    to.shape = &entry.shape;
    to.rotation = pose.rotation;
    detail::place(entry.shape, pose, origin_, to.now);
  }

  static detail::Round placed(const Entry& entry, const Pose& pose) {
    const Vector3d half =
        entry.half > 0 ? Vector3d(entry.half * pose.rotation.col(2)) : Vector3d(Vector3d::Zero());
    return {pose.position, half, entry.radius, entry.half > 0};
  }

  static void turn(NearPoints& out, int from) {
    for (int k = from; k < out.count; ++k) {
      std::swap(out.point[k].on_first, out.point[k].on_second);
      out.point[k].normal = -out.point[k].normal;
    }
  }

  void polyhedra(double margin, NearPoints& out) {
    const double size = std::min(a_.now.size, b_.now.size), tie = kTie * size;
    const double rounding = detail::kRounding * size;
    const FaceAxis A = best_face(a_, b_, rounding);
    if (A.separation >= margin) return;
    const FaceAxis B = best_face(b_, a_, rounding);
    if (B.separation >= margin) return;
    if (A.face < 0 || B.face < 0) return;  // places that are no numbers: the step says so
    const EdgeAxis E = best_edges(a_, b_, rounding);
    if (E.separation >= margin) return;
    const double best = std::max(A.separation, B.separation);
    if (E.separation > best + tie) {
      const int before = out.count;
      crossing_edges(a_, b_, E, tie, margin, out);
      // One point leaves bodies free to turn about it: what may close meanwhile is open now.
      if (out.count > before) over_face(A, B, tie, margin, size, 0, out);
      return;
    }
    const Vector3d &nA = a_.face(A.face).normal, &nB = b_.face(B.face).normal;
    if (std::abs(A.separation - B.separation) < tie && -nA.dot(nB) < kParallel)
      return edge_along_edge(a_, b_, (nA - nB).normalized(), rounding, margin, out);
    over_face(A, B, tie, margin, size, -kInfinity, out);
  }

  // The first body's face unless the second one's is clearly better, so that touching faces keep
  // their reference.
  void over_face(const FaceAxis& A, const FaceAxis& B, double tie, double margin, double size,
                 double least, NearPoints& out) {
    if (A.separation >= B.separation - tie) {
      const int from = out.count;
      clipper_.clip(a_, A.face, b_, least, margin, size, 0, out);
      turn(out, from);
    } else {
      clipper_.clip(b_, B.face, a_, least, margin, size, 1 << 15, out);
    }
  }

  std::unordered_map<int, Entry> entries_;
  Vector3d origin_ = Vector3d::Zero();
  Placed a_, b_;
  detail::FaceClipper clipper_;
};

}  // namespace

std::unique_ptr<PairCollision> make_polyhedra() { return std::make_unique<Polyhedra>(); }

}  // namespace tether::contact
