// Tether: a convex shape by its farthest points. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <tether/contact/shapes.hpp>
#include <vector>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// The feature of a surface that faces a direction: a point, the ends of a line, or the corners of
/// a face, counterclockwise seen from outside. The `id` of a corner is the same in every step.
struct Flat {
  static constexpr int kMost = 32;
  int count = 0;
  std::array<Eigen::Vector3d, kMost> point;
  std::array<int, kMost> id;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of a face, outwards

  void add(const Eigen::Vector3d& p, int i) {
    if (count == kMost) return;
    point[static_cast<std::size_t>(count)] = p;
    id[static_cast<std::size_t>(count++)] = i;
  }
};

/// A solid shape at its pose, relative to a common origin, by its support function h(m) = max m .
/// x. Balls and capsules are represented by their centre and axis; `round` is their radius.
class ConvexShape {
 public:
  ConvexShape(const Shape& shape, const Pose& pose, const Eigen::Vector3d& about)
      : origin(pose.position - about), rotation(pose.rotation), form_(&form(shape.kind)) {
    form_->begin(shape, *this);
    size = std::max(half.maxCoeff(), round);
  }
  /// A triangle, whose points must outlive this object. `thick` is the thickness of the shape that
  /// it is compared with; the triangle itself has none, and farthest() never shrinks it.
  ConvexShape(const std::vector<Eigen::Vector3d>& triangle, double thick)
      : points(&triangle), thickness(thick), whole(true), form_(&form(ShapeKind::convex)) {
    for (const Eigen::Vector3d& p : triangle) middle += p / 3;
    for (const Eigen::Vector3d& p : triangle) size = std::max(size, (p - middle).norm());
  }

  /// Farthest point in direction m (any length) of the shape, shrunk by `less` times its thickness.
  Eigen::Vector3d farthest(const Eigen::Vector3d& m, double less = 0) const {
    return origin + rotation * form_->farthest(*this, rotation.transpose() * m, less);
  }
  /// Second derivative of h at a unit vector m, where it is smooth.
  Eigen::Matrix3d curvature(const Eigen::Vector3d& m) const {
    return rotation * form_->curvature(*this, rotation.transpose() * m) * rotation.transpose();
  }
  /// Kinks of h near m, within a tolerance in radian. Returns the unit direction of a straight line
  /// of the surface at right angles to m, or zero; sets `face` to the normal of a face along m.
  Eigen::Vector3d line(const Eigen::Vector3d& m, double tolerance, Eigen::Vector3d& face) const {
    face.setZero();
    return form_->line(*this, m, tolerance, face);
  }
  /// The feature that faces m: all that lies within kFlatAngle or within `height` of it.
  void flat(const Eigen::Vector3d& m, double height, Flat& out) const {
    out.count = 0;
    out.normal.setZero();
    form_->flat(*this, m, height, out);
  }
  const Eigen::Vector3d& centre() const { return whole ? middle : origin; }
  Eigen::Vector3d axis(int k) const { return rotation.col(k); }

  // Set by ShapeForm::begin: half the extent along each axis, and the mean of the points of a hull.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero(), half = Eigen::Vector3d::Zero(),
                  middle = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  const std::vector<Eigen::Vector3d>* points = nullptr;
  double round = 0, thickness = 0, size = 0;
  bool whole = false;  // farthest() ignores `less`

 private:
  const ShapeForm* form_;
};

}  // namespace tether::contact::detail
