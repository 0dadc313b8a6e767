// Tether: the closed surface of a solid (detection, section 5). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <tether/contact/shapes.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>
#include <utility>
#include <vector>

#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// Throws std::invalid_argument("mesh: " + what).
[[noreturn]] void refuse_mesh(const std::string& what);

struct Plane {
  Eigen::Vector3d normal;
  double offset;
  double height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
};

/// A part of an edge at which the solid is not convex, with the planes of its triangles.
struct Hollow {
  Eigen::Vector3d from, to;
  std::array<int, 2> plane;
};

/// The closed surface of a mesh: checked, its edges joined, in units of its extent. It refers to
/// the triangles of the mesh.
class ClosedSurface {
 public:
  /// Throws std::invalid_argument with the triangle, edge or volume that is wrong.
  explicit ClosedSurface(const Shape& mesh);

  double unit() const { return unit_; }      ///< m
  double volume() const { return volume_; }  ///< of what it encloses
  const Eigen::Vector3d& middle() const { return middle_; }
  int triangles() const { return static_cast<int>(triangles_.size()); }
  const Eigen::Vector3d& corner(int t, int k) const {
    return points_[linalg::at(number_[linalg::at(triangles_[linalg::at(t)][linalg::at(k)])])];
  }
  int plane_of(int triangle) const { return plane_[linalg::at(triangle)]; }
  const Plane& plane(int k) const { return planes_[linalg::at(k)]; }
  const std::vector<Hollow>& hollows() const { return hollows_; }

  /// Whether a point is inside and not on the surface, from the solid angle of that (A. Van
  /// Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30, 1983, 125).
  bool contains(const Eigen::Vector3d& p) const;
  /// Throws std::invalid_argument if two triangles pass through each other.
  void demand_no_crossing() const;

 private:
  void set_points(const std::vector<Eigen::Vector3d>& points);
  void join_edges();
  void set_planes(linalg::DisjointSets& flat);
  std::pair<int, int> ends(int t, int k) const;
  std::string edge(int t, int k) const;
  bool passes(int s, int t) const;
  bool is_over(int t, const Eigen::Vector3d& x, double within) const;

  const std::vector<std::array<int, 3>>& triangles_;
  std::vector<Eigen::Vector3d> points_;  // without doubles
  std::vector<int> number_;              // of each given point, in points_
  std::vector<Eigen::Vector3d> normal_;
  std::vector<double> area_;  // twice
  std::vector<int> plane_;    // of each triangle
  std::vector<Plane> planes_;
  std::vector<Hollow> hollows_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double unit_ = 1, volume_ = 0;
};

}  // namespace tether::contact::detail
