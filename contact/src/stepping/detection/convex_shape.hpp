// Tether: a convex shape by its farthest points. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <tether/contact/shapes.hpp>

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

/// A shape at its pose, about a common origin, without the radius of balls and capsules: h(m) =
/// max m . x is its support function.
class ConvexShape {
 public:
  ConvexShape(const Shape& shape, const Pose& pose, const Eigen::Vector3d& origin);
  /// Three points, which must outlive this: never smaller than they are, however thin; `thickness`
  /// is that of what they touch.
  ConvexShape(const std::vector<Eigen::Vector3d>& triangle, double thickness);

  /// Farthest point in direction m (any length) of the shape less a part of its thickness.
  Eigen::Vector3d farthest(const Eigen::Vector3d& m, double less = 0) const;
  /// Second derivative of h at a unit vector m, where it is smooth.
  Eigen::Matrix3d curvature(const Eigen::Vector3d& m) const;
  /// Unit direction of the line that the surface holds across m, or zero: kinks of h at m. Sets
  /// `face` to the normal of a face against m.
  Eigen::Vector3d line(const Eigen::Vector3d& m, double tolerance, Eigen::Vector3d& face) const;
  /// The feature against m, up to an angle or up to a height.
  void flat(const Eigen::Vector3d& m, double height, Flat& out) const;

  const Eigen::Vector3d& centre() const { return whole_ ? middle_ : centre_; }
  Eigen::Vector3d axis(int k) const { return rotation_.col(k); }
  double radius() const { return round_; }
  double thickness() const { return thickness_; }

 private:
  void corners(const Eigen::Vector3d& m, double height, Flat& out) const;
  int corner_count() const;
  Eigen::Vector3d corner(int k) const;  // body axes

  ShapeKind kind_;
  Eigen::Vector3d centre_, half_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();  // of the points of a hull, body axes
  Eigen::Matrix3d rotation_;
  const std::vector<Eigen::Vector3d>* points_ = nullptr;
  double round_ = 0, thickness_ = 0, size_ = 0;
  bool whole_ = false;  // no part of the thickness is taken off
};

}  // namespace tether::contact::detail
