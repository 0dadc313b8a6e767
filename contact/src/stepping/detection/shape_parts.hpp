// Tether: parts that several kinds of shapes share. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "stepping/detection/convex_shape.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

// A tilt whose sine is smaller is rounding: it has no direction.
constexpr double kUpright = 1e-9;

inline double signed_one(double x) { return x < 0 ? -1 : 1; }

inline void demand_positive(const Shape& shape, double x, const char* what) {
  if (!(x > 0) || !std::isfinite(x))
    throw std::invalid_argument(std::string(name(shape.kind)) + ": " + what +
                                " must be > 0 and finite");
}

/// Throws std::invalid_argument unless there are at least so many finite points, not all at the
/// origin.
void check_points(const Shape& shape, std::size_t least);
double reach_of_points(const Shape& shape);
void points_on_plane(const Shape& shape, const Pose& pose, const Eigen::Vector3d& plane,
                     const Eigen::Vector3d& n, double margin, NearPoints& out);

/// Adds the contact of a point p, or of a ball, with the plane through `plane` with the normal n.
inline void point_plane(const Eigen::Vector3d& p, const Eigen::Vector3d& plane,
                        const Eigen::Vector3d& n, double margin, int feature, NearPoints& out) {
  const double gap = n.dot(p - plane);
  if (gap < margin) out.add(p, p - gap * n, n, gap, feature);
}
inline void ball_plane(const Eigen::Vector3d& centre, double radius, const Eigen::Vector3d& plane,
                       const Eigen::Vector3d& n, double margin, int feature, NearPoints& out) {
  const double distance = n.dot(centre - plane);
  if (distance - radius < margin)
    out.add(centre - radius * n, centre - distance * n, n, distance - radius, feature);
}

/// Nearest point to p of the ball about `centre`. Its normal is `out` if p is the centre.
inline Nearest on_ball(const Eigen::Vector3d& centre, double radius, const Eigen::Vector3d& p,
                       const Eigen::Vector3d& out) {
  const Eigen::Vector3d d = p - centre;
  const double distance = d.norm();
  const Eigen::Vector3d n = distance > 0 ? Eigen::Vector3d(d / distance) : out;
  return {centre + radius * n, n, distance - radius};
}

/// A corner of a box between -half and half.
inline Eigen::Vector3d box_corner(int k, const Eigen::Vector3d& half) {
  return {(k & 1) != 0 ? half.x() : -half.x(), (k & 2) != 0 ? half.y() : -half.y(),
          (k & 4) != 0 ? half.z() : -half.z()};
}

/// Boxes and hulls, by their corners.
class CorneredForm : public ShapeForm {
 public:
  explicit CorneredForm(int rank) : ShapeForm(Family::polyhedron, rank) {}
  Eigen::Vector3d line(const ConvexShape& shape, const Eigen::Vector3d& m, double tolerance,
                       Eigen::Vector3d& face) const override;
  void flat(const ConvexShape& shape, const Eigen::Vector3d& m, double height,
            Flat& out) const override;

 private:
  virtual int corner_count(const ConvexShape& shape) const = 0;
  virtual Eigen::Vector3d corner(const ConvexShape& shape, int k) const = 0;  // body axes
  void corners(const ConvexShape& shape, const Eigen::Vector3d& m, double height, Flat& out) const;
};

}  // namespace tether::contact::detail
