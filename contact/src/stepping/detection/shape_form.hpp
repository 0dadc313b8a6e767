// Tether: what detection knows of one kind of shape. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <tether/contact/shapes.hpp>

namespace tether::contact::detail {

constexpr double kFlatAngle = 0.05;  // radian: faces and lines up to here lie against each other

class ConvexShape;
struct Flat;
struct Polyhedron;

/// Nearest point of the surface of a shape to a point, in the axes of the shape.
struct Nearest {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();     ///< unit, out of the shape
  double gap = std::numeric_limits<double>::infinity();  ///< along it; < 0: the point is inside
};

/// One for each kind of shape, in a file of its own: <kind>_form().
class ShapeForm {
 public:
  /// Decides by which algorithm two shapes meet.
  enum class Family : std::uint8_t { ball, polyhedron, curved, points, plane, mesh };

  /// The shape of lower rank comes first where the points of two are found.
  ShapeForm(Family family, int rank) : family_(family), rank_(rank) {}
  virtual ~ShapeForm() = default;
  Family family() const { return family_; }
  int rank() const { return rank_; }
  bool has_inside() const { return family_ <= Family::curved; }

  /// Throws std::invalid_argument unless the shape has the sizes that its kind needs.
  virtual void check(const Shape& shape) const = 0;
  /// Farthest point from its origin, infinite for planes.
  virtual double reach(const Shape& shape) const = 0;
  /// Adds its points against the plane through a point across n.
  virtual void on_plane(const Shape&, const Pose&, const Eigen::Vector3d& /*on_plane*/,
                        const Eigen::Vector3d& /*n*/, double /*margin*/, NearPoints&) const {}
  /// Exact outside and inside (detection, 5); of a kind without it, none.
  virtual Nearest nearest(const Shape&, const Eigen::Vector3d&) const { return {}; }
  virtual bool has_nearest() const { return false; }
  virtual void make_polyhedron(const Shape&, Polyhedron&) const {}

  // Shapes with an inside, see ConvexShape.

  virtual void begin(const Shape&, ConvexShape&) const {}
  /// In the axes of the shape, as `m`.
  virtual Eigen::Vector3d farthest(const ConvexShape&, const Eigen::Vector3d& /*m*/,
                                   double /*less*/) const {
    return Eigen::Vector3d::Zero();
  }
  virtual Eigen::Matrix3d curvature(const ConvexShape&, const Eigen::Vector3d& /*m*/) const {
    return Eigen::Matrix3d::Zero();
  }
  virtual Eigen::Vector3d line(const ConvexShape&, const Eigen::Vector3d& /*m*/,
                               double /*tolerance*/, Eigen::Vector3d& /*face*/) const {
    return Eigen::Vector3d::Zero();
  }
  /// By default the farthest point alone: round shapes.
  virtual void flat(const ConvexShape& shape, const Eigen::Vector3d& m, double height,
                    Flat& out) const;

 private:
  Family family_;
  int rank_;
};

const ShapeForm& form(ShapeKind kind);

#define TETHER_SHAPE_FORM(kind, Form) \
  const ShapeForm& kind##_form() {    \
    static const Form the_only_one;   \
    return the_only_one;              \
  }

}  // namespace tether::contact::detail
