// Tether: where a point is nearest to a shape. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/point_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

// Nearest point of a ball about `centre`; its normal is `out` if the given point is the centre.
Nearest on_ball(const Vector3d& centre, double radius, const Vector3d& p, const Vector3d& out) {
  const Vector3d d = p - centre;
  const double distance = d.norm();
  const Vector3d n = distance > 0 ? Vector3d(d / distance) : out;
  return {centre + radius * n, n, distance - radius};
}

Nearest on_box(const Vector3d& half, const Vector3d& p) {
  const Vector3d inside = p.cwiseMax(-half).cwiseMin(half), d = p - inside;
  const double distance = d.norm();
  if (distance > 0) return {inside, d / distance, distance};
  int axis = 0;
  const double depth = (half - p.cwiseAbs()).minCoeff(&axis);
  const double side = p[axis] < 0 ? -1 : 1;
  Nearest out;
  out.point = p;
  out.point[axis] = side * half[axis];
  out.normal = side * Vector3d::Unit(axis);
  out.gap = -depth;
  return out;
}

// As of a rectangle: distance from the axis, place along it.
Nearest on_cylinder(double radius, double half, const Vector3d& p) {
  const double across = std::hypot(p.x(), p.y());
  const Vector3d way =
      across > 0 ? Vector3d(p.x() / across, p.y() / across, 0) : Vector3d(Vector3d::UnitX());
  const double r = std::min(across, radius), z = std::clamp(p.z(), -half, half);
  const double distance = std::hypot(across - r, p.z() - z);
  if (distance > 0)
    return {r * way + z * Vector3d::UnitZ(),
            (across - r) / distance * way + (p.z() - z) / distance * Vector3d::UnitZ(), distance};
  const double end = p.z() < 0 ? -1 : 1;
  if (radius - across < half - std::abs(p.z()))
    return {radius * way + z * Vector3d::UnitZ(), way, across - radius};
  return {{p.x(), p.y(), end * half}, end * Vector3d::UnitZ(), std::abs(p.z()) - half};
}

// The nearest point x has p - x = t x / a^2 (component by component), with the largest t that puts
// x onto the surface. With the least half axis c: t = (u - 1) c^2, q = a^2 / c^2, and
//   |w(u)| = 1,   w = (q p / a) / (u + q - 1),   u > 0.
// Newton's method for 1 / |w| = 1, which is concave, from a u that is too small never goes too far.
Nearest on_ellipsoid(const Vector3d& a, const Vector3d& p) {
  int least = 0;
  const double c = a.minCoeff(&least);
  const Vector3d ratio = a / c;
  Vector3d more, z;  // q - 1; q |p| / a
  for (int k = 0; k < 3; ++k) {
    more[k] = (ratio[k] - 1) * (ratio[k] + 1);
    z[k] = ratio[k] * std::abs(p[k]) / c;
  }
  double slope = 0;
  const auto place = [&](double u) {
    Vector3d w = Vector3d::Zero();
    slope = 0;
    for (int k = 0; k < 3; ++k) {
      if (!(z[k] > 0)) continue;
      w[k] = z[k] / (u + more[k]);
      slope += w[k] * w[k] / (u + more[k]);
    }
    return w;
  };
  double u = std::max(0.0, (z - more).maxCoeff());
  Vector3d x = place(u);  // in parts of the half axes
  if (u == 0 && x.squaredNorm() < 1) {
    // On the disc inside from which both sides across the least axis are as near.
    x[least] = std::sqrt(1 - x.squaredNorm());
  } else {
    for (int k = 0; k < 100; ++k) {
      const double norm = x.norm(), step = (norm - 1) * norm * norm / slope;
      if (!(step > 1e-16 * u)) break;
      u += step;
      x = place(u);
    }
    x.normalize();
  }
  for (int k = 0; k < 3; ++k)
    if (p[k] < 0) x[k] = -x[k];
  Nearest out;
  out.point = x.cwiseProduct(a);
  out.normal = x.cwiseQuotient(ratio).normalized();
  out.gap = out.normal.dot(p - out.point);
  return out;
}

}  // namespace

Nearest nearest_on(const Shape& s, const Vector3d& p) {
  switch (s.kind) {
    case ShapeKind::sphere:
      return on_ball(Vector3d::Zero(), s.radius, p, Vector3d::UnitZ());
    case ShapeKind::capsule: {
      const Vector3d foot(0, 0, std::clamp(p.z(), -0.5 * s.length, 0.5 * s.length));
      return on_ball(foot, s.radius, p, Vector3d::UnitX());
    }
    case ShapeKind::box:
      return on_box(0.5 * s.size, p);
    case ShapeKind::ellipsoid:
      return on_ellipsoid(s.size, p);
    case ShapeKind::cylinder:
      return on_cylinder(s.radius, 0.5 * s.length, p);
    case ShapeKind::plane:
    case ShapeKind::convex:
    case ShapeKind::points:
    case ShapeKind::mesh:
      break;
  }
  Nearest nothing;
  nothing.gap = std::numeric_limits<double>::infinity();
  return nothing;
}

void collide_points(const Shape& points, const Pose& pose, const Shape& shape,
                    const Pose& shape_pose, double margin, NearPoints& out) {
  // To one of the two positions first: so the way between them loses nothing far from the origin.
  const Eigen::Matrix3d turn = shape_pose.rotation.transpose();
  const Vector3d between = pose.position - shape_pose.position;
  for (std::size_t k = 0; k < points.points.size(); ++k) {
    const Vector3d arm = pose.rotation * points.points[k];
    const Nearest at = nearest_on(shape, turn * (between + arm));
    if (at.gap < margin)
      out.add(pose.position + arm, shape_pose.position + shape_pose.rotation * at.point,
              shape_pose.rotation * at.normal, at.gap, static_cast<int>(k));
  }
}

}  // namespace tether::contact::detail
