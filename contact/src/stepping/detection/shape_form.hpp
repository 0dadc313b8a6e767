// Tether: the interface of a kind of shape to detection. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tether/contact/shapes.hpp>
#include <vector>

namespace tether::contact::detail {

// Faces and lines that are parallel up to this angle (radian) touch along their whole extent.
constexpr double kFlatAngle = 0.05;

// Sizes of what is not told apart: angles in radian, and lengths in parts of the thickness or of
// the longest extent. kNear: what an iteration leaves in a direction, and depths or distances of
// surfaces that touch. kInPlane: distances of corners from a plane or from each other, as for hulls
// (linalg/convex_hull.hpp); a tenth of kNear, since parts of a mesh are cut and rounded one by one.
// kUpright: rounding, of which a direction would be made.
constexpr double kNear = 1e-6, kInPlane = 1e-7, kUpright = 1e-9;

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

/// The feature of a surface that faces a direction: a point, the ends of a line, or the corners of
/// a face, counterclockwise seen from outside. The `id` of a corner is the same in every step.
/// `edge`: that of another face at which a corner was cut, -1 for an original one.
struct Flat {
  static constexpr int kMost = 48;
  int count = 0;
  std::array<Eigen::Vector3d, kMost> point;
  std::array<int, kMost> id, edge;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of a face, outwards

  void add(const Eigen::Vector3d& p, int i, int cut_at = -1) {
    if (count == kMost) return;
    const auto k = static_cast<std::size_t>(count++);
    point[k] = p;
    id[k] = i;
    edge[k] = cut_at;
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

/// The point of a segment nearest to p.
inline Eigen::Vector3d nearest_on_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& from,
                                          const Eigen::Vector3d& to) {
  const Eigen::Vector3d d = to - from;
  const double length2 = d.squaredNorm();
  if (!(length2 > 0)) return from;
  return from + std::clamp((p - from).dot(d) / length2, 0.0, 1.0) * d;
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
