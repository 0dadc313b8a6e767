// Tether: parts that several kinds of shapes share. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/shape_form.hpp"

#include <algorithm>
#include <array>
#include <tether/linalg/index.hpp>
#include <tether/linalg/pi.hpp>

namespace tether::contact {

using Eigen::Vector3d;
using linalg::at;

const char* name(ShapeKind kind) {
#define SHAPE(each) \
  if (kind == ShapeKind::each) return #each;
#include "shape_list.inc"
#undef SHAPE
  return "";
}

namespace detail {

#define SHAPE(kind) const ShapeForm& kind##_form();
#include "shape_list.inc"
#undef SHAPE

#define SHAPE(kind) +1
static_assert(0
#include "shape_list.inc"
                  == kShapeKinds.size(),
              "each kind has a file in the folder shapes");
#undef SHAPE

// Called for every pair of near bodies, hence a table.
const ShapeForm& form(ShapeKind kind) {
  static const std::array forms = [] {
    std::array<const ShapeForm*, kShapeKinds.size()> all{};
#define SHAPE(each) all[static_cast<std::size_t>(ShapeKind::each)] = &each##_form();
#include "shape_list.inc"
#undef SHAPE
    return all;
  }();
  const auto k = static_cast<std::size_t>(kind);
  if (k >= forms.size()) throw std::logic_error("a shape of no kind");
  return *forms[k];
}

void ShapeForm::flat(const ConvexShape& s, const Vector3d& m, double, Flat& out) const {
  out.add(s.farthest(m), 0);
}

void check_points(const Shape& s, std::size_t least) {
  if (s.points.size() < least || s.points.size() > 65536)
    throw std::invalid_argument(std::string(name(s.kind)) +
                                ": needs 4 (points: 1) to 65536 points");
  for (const Vector3d& p : s.points)
    if (!p.allFinite())
      throw std::invalid_argument(std::string(name(s.kind)) + ": points must be finite");
  demand_positive(s, reach_of_points(s), "extent");
}

double reach_of_points(const Shape& s) {
  double most = 0;
  for (const Vector3d& p : s.points) most = std::max(most, p.norm());
  return most;
}

void points_on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                     double margin, NearPoints& out) {
  for (std::size_t k = 0; k < s.points.size(); ++k)
    point_plane(pose.position + pose.rotation * s.points[k], plane, n, margin, static_cast<int>(k),
                out);
}

Vector3d CorneredForm::line(const ConvexShape& s, const Vector3d& direction, double tolerance,
                            Vector3d& face) const {
  Flat flat;
  corners(s, direction, tolerance * s.size, flat);
  if (flat.count < 2) return Vector3d::Zero();
  if (flat.count > 2) {
    face = flat.normal;
    return Vector3d::Zero();
  }
  return (flat.point[1] - flat.point[0]).normalized();
}

// The corners within `height` of the farthest one, ordered around m. They are those that lie
// farthest in some direction across m, so that no faces of the hull are needed.
void CorneredForm::corners(const ConvexShape& s, const Vector3d& direction, double height,
                           Flat& out) const {
  const Vector3d m = s.rotation.transpose() * direction;
  const int n = corner_count(s);
  double most = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < n; ++k) most = std::max(most, m.dot(corner(s, k)));
  int axis = 0;
  m.cwiseAbs().minCoeff(&axis);
  const Vector3d side = m.cross(Vector3d::Unit(axis)).normalized(), other = m.cross(side);
  constexpr int kRound = 32;
  out.count = 0;
  for (int d = 0; d < kRound; ++d) {
    const double angle = 2 * linalg::kPi * (d + 0.3) / kRound;
    const Vector3d u = std::cos(angle) * side + std::sin(angle) * other;
    int best = -1;
    double far = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < n; ++k) {
      const Vector3d p = corner(s, k);
      if (m.dot(p) < most - height || !(u.dot(p) > far)) continue;
      far = u.dot(p);
      best = k;
    }
    if (best < 0) continue;  // the heights are NaN
    if (out.count > 0 && (out.id[at(out.count - 1)] == best || out.id[0] == best)) continue;
    out.add(s.origin + s.rotation * corner(s, best), best);
  }
  if (out.count < 3) return;
  // Newell's normal.
  Vector3d area = Vector3d::Zero();
  for (int k = 1; k + 1 < out.count; ++k)
    area += (out.point[at(k)] - out.point[0]).cross(out.point[at(k + 1)] - out.point[0]);
  const double length = area.norm();
  if (length > 1e-9 * s.size * s.size) {
    out.normal = area / length;
    return;
  }
  // The corners lie on a line: only its ends count.
  int a = 0, b = 1;
  for (int k = 0; k < out.count; ++k)
    if ((out.point[at(k)] - out.point[at(a)]).squaredNorm() >
        (out.point[at(b)] - out.point[at(a)]).squaredNorm())
      b = k;
  const Vector3d p = out.point[at(a)], q = out.point[at(b)];
  const int i = out.id[at(a)], j = out.id[at(b)];
  out.count = 0;
  out.add(p, i);
  out.add(q, j);
}

// Corners that do not lie in one plane belong to several faces. The height is then reduced until
// one face is left.
void CorneredForm::flat(const ConvexShape& s, const Vector3d& direction, double height,
                        Flat& out) const {
  double h = std::max(height, kFlatAngle * s.thickness);
  for (corners(s, direction, h, out); out.count > 3 && h > 1e-9 * s.size;
       corners(s, direction, h, out)) {
    const double level = out.normal.dot(out.point[0]);
    double off = 0;
    for (int k = 1; k < out.count; ++k)
      off = std::max(off, std::abs(out.normal.dot(out.point[at(k)]) - level));
    if (off < 1e-6 * s.size) break;
    h /= 4;
  }
}

}  // namespace detail
}  // namespace tether::contact
