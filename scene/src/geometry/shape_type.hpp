// Tether: what scenes know of one kind of shape. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/linalg/pi.hpp>
#include <tether/scene/scene.hpp>
#include <variant>

#include "mass.hpp"
#include "mesh.hpp"
#include "outline.hpp"
#include "toml/reader.hpp"

namespace tether::scene {

/// A part of a shape as scene files have it.
struct ShapeField {
  const char* key;
  std::variant<double Shape::*, Eigen::Vector3d Shape::*, std::vector<Eigen::Vector3d> Shape::*,
               std::vector<std::array<int, 3>> Shape::*>
      value;
  const char* meaning;  ///< what is missing without it; null: a direction, which may be
  const char* unit = "m";
  std::size_t least = 0;  ///< of points
};

/// One for each kind of shape, in a file of its own: <kind>_type(). All is in the axes of the
/// shape, but for the outline.
class ShapeType {
 public:
  virtual ~ShapeType() = default;
  virtual std::vector<ShapeField> fields() const = 0;
  virtual void read(files::Fields& in, files::Reader& r, Shape& shape) const;
  virtual MassProperties solid(const Shape&) const { return {}; }
  virtual Mesh polygons(const Shape& shape, int around, double half_plane) const = 0;
  /// In the axes of the body; a kind without one is unknown to the event engine.
  virtual bool add_outline(const Shape&, Outline&) const { return false; }
  /// It is drawn as its silhouette.
  virtual bool is_round() const { return false; }
  /// Makes the shape, about its origin, one of size 1, and tells its size along its axes; of kinds
  /// that have no such, nothing.
  virtual std::optional<Eigen::Vector3d> make_unit(Shape&) const { return {}; }
};

/// The importer, a library of its own, asks it, too.
TETHER_EXPORT_BEGIN
const ShapeType& type_of(ShapeKind kind);
TETHER_EXPORT_END

#define TETHER_SHAPE_TYPE(kind, Type) \
  const ShapeType& kind##_type() {    \
    static const Type the_only_one;   \
    return the_only_one;              \
  }

/// A sphere, an ellipsoid or a capsule, whose half spheres are `length` apart along z.
Mesh capsule_mesh(double radius, double length, int around);
/// A solid in which the mean square of a coordinate is a part of that length squared: 1 / part.
MassProperties along_axes(double volume, const Eigen::Vector3d& lengths, double part);
/// Faces of the hull of points, or these one by one.
Mesh points_mesh(const std::vector<Eigen::Vector3d>& points);

}  // namespace tether::scene
