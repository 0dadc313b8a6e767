// Tether: a convex shape by its farthest points. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <tether/contact/shapes.hpp>
#include <vector>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// The part of a surface that lies against a plane: a point, the ends of a line, or the corners of
/// a face, counterclockwise seen from outside. `id` of a corner stays from step to step.
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

/// A shape with an inside at its pose, about a common origin, without the radius of balls and
/// capsules: h(m) = max m . x is its support function.
class ConvexShape {
 public:
  ConvexShape(const Shape& shape, const Pose& pose, const Eigen::Vector3d& about)
      : origin(pose.position - about), rotation(pose.rotation), form_(&form(shape.kind)) {
    form_->begin(shape, *this);
    size = std::max(half.maxCoeff(), round);
  }
  /// Three points, which must outlive this: never smaller than they are, however thin; `thick` is
  /// the thickness of what they touch.
  ConvexShape(const std::vector<Eigen::Vector3d>& triangle, double thick)
      : points(&triangle), thickness(thick), whole(true), form_(&form(ShapeKind::convex)) {
    for (const Eigen::Vector3d& p : triangle) middle += p / 3;
    for (const Eigen::Vector3d& p : triangle) size = std::max(size, (p - middle).norm());
  }

  /// Farthest point in direction m (any length) of the shape less a part of its thickness.
  Eigen::Vector3d farthest(const Eigen::Vector3d& m, double less = 0) const {
    return origin + rotation * form_->farthest(*this, rotation.transpose() * m, less);
  }
  /// Second derivative of h at a unit vector m, where it is smooth.
  Eigen::Matrix3d curvature(const Eigen::Vector3d& m) const {
    return rotation * form_->curvature(*this, rotation.transpose() * m) * rotation.transpose();
  }
  /// Unit direction of the line that the surface holds across m, or zero: kinks of h at m. Sets
  /// `face` to the normal of a face against m.
  Eigen::Vector3d line(const Eigen::Vector3d& m, double tolerance, Eigen::Vector3d& face) const {
    face.setZero();
    return form_->line(*this, m, tolerance, face);
  }
  /// The feature against m, up to an angle or up to a height.
  void flat(const Eigen::Vector3d& m, double height, Flat& out) const {
    out.count = 0;
    out.normal.setZero();
    form_->flat(*this, m, height, out);
  }
  const Eigen::Vector3d& centre() const { return whole ? middle : origin; }
  Eigen::Vector3d axis(int k) const { return rotation.col(k); }

  // As its form has set them: half of what it measures along its axes, the middle of the points of
  // a hull.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero(), half = Eigen::Vector3d::Zero(),
                  middle = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  const std::vector<Eigen::Vector3d>* points = nullptr;
  double round = 0, thickness = 0, size = 0;
  bool whole = false;  // no part of the thickness is taken off

 private:
  const ShapeForm* form_;
};

}  // namespace tether::contact::detail
