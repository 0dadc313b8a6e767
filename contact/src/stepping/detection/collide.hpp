// Tether: where two shapes are near each other. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/index.hpp>

#include "stepping/detection/clip.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact::detail {

/// Unit normal from b to a, and the points of both that are nearest to each other along it.
struct Separation {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ(), on_first = Eigen::Vector3d::Zero(),
                  on_second = Eigen::Vector3d::Zero();
  double gap = 0;
};

/// s(n) = min over a of n.x - max over b of n.y: the gap along n.
double separation(const ConvexShape& a, const ConvexShape& b, const Eigen::Vector3d& n);

/// Finds the direction of the largest separation (detection, section 3). Returns false if the gap
/// is at least `margin`.
bool find_separation(const ConvexShape& a, const ConvexShape& b, double margin, Separation& out);

// Parts of a surface up to this height, relative to the thickness, may touch.
constexpr double kHigh = 0.1;

// Features of the points where the border of a face cuts another shape's.
constexpr int kCut = 0x800, kNoCut = 0x7f00;

/// Cuts off what of a line or a face lies beyond an edge from `from`; id(j) is that of a cut beside
/// corner j.
template <class Id>
void clip(Flat& subject, const Eigen::Vector3d& inward, const Eigen::Vector3d& from, int edge,
          const Id& id) {
  Flat kept;
  kept.normal = subject.normal;
  cut_polygon(
      linalg::at(subject.count), inward, from,
      [&](std::size_t j) -> const Eigen::Vector3d& { return subject.point[j]; },
      [&](std::size_t j) { kept.add(subject.point[j], subject.id[j], subject.edge[j]); },
      [&](std::size_t j, std::size_t, const Eigen::Vector3d& x, bool) {
        kept.add(x, id(j), edge);
      });
  subject = kept;
}

/// Two shapes relative to a common origin, their separation, and the list that contacts go to.
struct ConvexPair {
  const ConvexShape &a, &b;
  const Eigen::Vector3d& origin;
  const Separation& apart;
  double margin;
  NearPoints& out;

  /// Parts of either surface within this distance along the normal may touch.
  double height() const;
  /// Adds a contact at `on_a`. `core_gap` is the gap along the normal without the radii of balls.
  void add(const Eigen::Vector3d& on_a, double core_gap, int feature) const;
};

/// Adds all contacts between the features s of a and t of b that face each other. Clips s and t.
void manifold(const ConvexPair& pair, Flat& s, Flat& t);

/// Whether two shapes can touch each other.
bool has_collision(ShapeKind a, ShapeKind b);

/// Adds all points with a gap below `margin`, of shapes that are no mesh and do not
/// meet_as_polyhedra(); normals point from b to a.
void collide(const Shape& a, const Pose& pose_a, const Shape& b, const Pose& pose_b, double margin,
             NearPoints& out);

/// Exchanges the shapes of all points from this one on.
void turn(NearPoints& out, int from);

/// Throws std::invalid_argument unless the shape has the sizes that its kind needs.
void check(const Shape& shape);

}  // namespace tether::contact::detail
