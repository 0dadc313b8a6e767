// Tether: the interface of a kind of shape to detection. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <tether/contact/shapes.hpp>

namespace tether::contact::detail {

// Faces and lines that are parallel up to this angle (radian) touch along their whole extent.
constexpr double kFlatAngle = 0.05;

class ConvexShape;
struct Flat;
struct Polyhedron;

/// Nearest point of the surface of a shape to a point, in the axes of the shape.
struct Nearest {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();     ///< unit, out of the shape
  double gap = std::numeric_limits<double>::infinity();  ///< along the normal; < 0: inside
};

/// Geometry of one kind of shape. Each kind has one object, <kind>_form(), in a file of its own.
class ShapeForm {
 public:
  /// Decides by which algorithm two shapes meet.
  enum class Family : std::uint8_t { ball, polyhedron, curved, points, plane, mesh };

  /// `rank` orders the two shapes of a pair: the lower one is the first argument of collide().
  ShapeForm(Family family, int rank) : family_(family), rank_(rank) {}
  virtual ~ShapeForm() = default;
  Family family() const { return family_; }
  int rank() const { return rank_; }
  bool has_inside() const { return family_ <= Family::curved; }

  /// Throws std::invalid_argument unless the shape has the sizes that its kind needs.
  virtual void check(const Shape& shape) const = 0;
  /// Farthest point from its origin, infinite for planes.
  virtual double reach(const Shape& shape) const = 0;
  /// Adds its contacts with the plane through `on_plane` with the normal n.
  virtual void on_plane(const Shape&, const Pose&, const Eigen::Vector3d& /*on_plane*/,
                        const Eigen::Vector3d& /*n*/, double /*margin*/, NearPoints&) const {}
  /// Nearest point of the surface, exact outside and inside (detection, section 6).
  virtual Nearest nearest(const Shape&, const Eigen::Vector3d&) const { return {}; }
  virtual bool has_nearest() const { return false; }
  virtual void make_polyhedron(const Shape&, Polyhedron&) const {}

  // Solid shapes implement the following members; ConvexShape documents them.

  virtual void begin(const Shape&, ConvexShape&) const {}
  /// m and the result are in the axes of the shape.
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
  /// By default the farthest point alone, as for round shapes.
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
