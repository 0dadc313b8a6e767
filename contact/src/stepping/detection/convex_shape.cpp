// Tether: a convex shape by its farthest points. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/convex_shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/index.hpp>
#include <tether/linalg/pi.hpp>

namespace tether::contact::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr double kFlatAngle = 0.05;  // radian: up to here a face or a line lies against a plane
constexpr int kRim = 8;              // points of a cylinder's rim
constexpr double kUpright = 1e-9;    // sine of a tilt without direction

double signed_one(double x) { return x < 0 ? -1 : 1; }

}  // namespace

ConvexShape::ConvexShape(const Shape& s, const Pose& pose, const Vector3d& origin)
    : kind_(s.kind), centre_(pose.position - origin), rotation_(pose.rotation) {
  switch (kind_) {
    case ShapeKind::ellipsoid:
      half_ = s.size;
      thickness_ = half_.minCoeff();
      break;
    case ShapeKind::cylinder:
      half_ = Vector3d(s.radius, s.radius, 0.5 * s.length);
      thickness_ = half_.minCoeff();
      break;
    case ShapeKind::box:
      half_ = 0.5 * s.size;
      thickness_ = half_.minCoeff();
      break;
    case ShapeKind::capsule:
      half_.z() = 0.5 * s.length;
      round_ = s.radius;
      thickness_ = s.radius;
      break;
    case ShapeKind::sphere:
      rotation_.setIdentity();
      round_ = s.radius;
      thickness_ = s.radius;
      break;
    case ShapeKind::convex: {
      points_ = &s.points;
      for (const Vector3d& p : s.points) middle_ += p / static_cast<double>(s.points.size());
      Vector3d low = s.points[0], high = low;
      for (const Vector3d& p : s.points) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
      half_ = 0.5 * (high - low);
      thickness_ = half_.minCoeff();
      break;
    }
    case ShapeKind::plane:
    case ShapeKind::points:
    case ShapeKind::mesh:
      break;
  }
  size_ = std::max(half_.maxCoeff(), round_);
}

ConvexShape::ConvexShape(const std::vector<Vector3d>& triangle, double thickness)
    : kind_(ShapeKind::convex),
      centre_(Vector3d::Zero()),
      rotation_(Matrix3d::Identity()),
      points_(&triangle),
      thickness_(thickness),
      whole_(true) {
  for (const Vector3d& p : triangle) middle_ += p / 3;
  for (const Vector3d& p : triangle) size_ = std::max(size_, (p - middle_).norm());
}

int ConvexShape::corner_count() const {
  return kind_ == ShapeKind::box ? 8 : static_cast<int>(points_->size());
}

Vector3d ConvexShape::corner(int k) const {
  if (kind_ == ShapeKind::convex) return (*points_)[at(k)];
  return {(k & 1) != 0 ? half_.x() : -half_.x(), (k & 2) != 0 ? half_.y() : -half_.y(),
          (k & 4) != 0 ? half_.z() : -half_.z()};
}

Vector3d ConvexShape::farthest(const Vector3d& direction, double less) const {
  const Vector3d m = rotation_.transpose() * direction;
  const double part = 1 - less;
  Vector3d x = Vector3d::Zero();
  switch (kind_) {
    case ShapeKind::ellipsoid: {
      const Vector3d scaled = half_.cwiseProduct(m);
      const double h = scaled.norm();
      if (h > 0) x = part / h * half_.cwiseProduct(scaled);
      break;
    }
    case ShapeKind::cylinder: {
      const double across = std::hypot(m.x(), m.y()), r = half_.x() - less * thickness_;
      if (across > 0) x = Vector3d(r * m.x() / across, r * m.y() / across, 0);
      x.z() = signed_one(m.z()) * (half_.z() - less * thickness_);
      break;
    }
    case ShapeKind::box:
      for (int k = 0; k < 3; ++k) x[k] = signed_one(m[k]) * (half_[k] - less * thickness_);
      break;
    case ShapeKind::capsule:
      x.z() = signed_one(m.z()) * half_.z();
      break;
    case ShapeKind::convex: {
      double most = -std::numeric_limits<double>::infinity();
      for (const Vector3d& p : *points_)
        if (m.dot(p) > most) {
          most = m.dot(p);
          x = p;
        }
      if (!whole_) x = middle_ + part * (x - middle_);
      break;
    }
    case ShapeKind::sphere:
    case ShapeKind::plane:
    case ShapeKind::points:
    case ShapeKind::mesh:
      break;
  }
  return centre_ + rotation_ * x;
}

Matrix3d ConvexShape::curvature(const Vector3d& direction) const {
  const Vector3d m = rotation_.transpose() * direction;
  Matrix3d H = Matrix3d::Zero();
  if (kind_ == ShapeKind::ellipsoid) {
    const Vector3d square = half_.cwiseProduct(half_), x = square.cwiseProduct(m);
    const double h = half_.cwiseProduct(m).norm();
    H = square.asDiagonal();
    H = Matrix3d(H / h - x * x.transpose() / (h * h * h));
  } else if (kind_ == ShapeKind::cylinder) {
    const double across = std::hypot(m.x(), m.y());
    if (across > 1e-6) {
      const Vector3d side(-m.y() / across, m.x() / across, 0);
      H = half_.x() / across * side * side.transpose();
    }
  }
  return rotation_ * H * rotation_.transpose();
}

Vector3d ConvexShape::line(const Vector3d& direction, double tolerance, Vector3d& face) const {
  face.setZero();
  if (kind_ == ShapeKind::cylinder || kind_ == ShapeKind::capsule) {
    const Vector3d z = rotation_.col(2);
    const double along = z.dot(direction);
    if (kind_ == ShapeKind::cylinder && z.cross(direction).norm() < tolerance)
      face = signed_one(along) * z;
    return std::abs(along) < tolerance && half_.z() > 0 ? z : Vector3d(Vector3d::Zero());
  }
  if (kind_ != ShapeKind::box && kind_ != ShapeKind::convex) return Vector3d::Zero();
  Flat flat;
  corners(direction, tolerance * size_, flat);
  if (flat.count < 2) return Vector3d::Zero();
  if (flat.count > 2) {
    face = flat.normal;
    return Vector3d::Zero();
  }
  return (flat.point[1] - flat.point[0]).normalized();
}

// Corners within `height` of the farthest one, in the order of the directions round m in which
// they lie farthest: a hull needs no faces for it.
void ConvexShape::corners(const Vector3d& direction, double height, Flat& out) const {
  const Vector3d m = rotation_.transpose() * direction;
  const int n = corner_count();
  double most = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < n; ++k) most = std::max(most, m.dot(corner(k)));
  int axis = 0;
  m.cwiseAbs().minCoeff(&axis);
  const Vector3d s = m.cross(Vector3d::Unit(axis)).normalized(), t = m.cross(s);
  constexpr int kRound = 32;
  out.count = 0;
  for (int d = 0; d < kRound; ++d) {
    const double angle = 2 * linalg::kPi * (d + 0.3) / kRound;
    const Vector3d u = std::cos(angle) * s + std::sin(angle) * t;
    int best = -1;
    double far = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < n; ++k) {
      const Vector3d p = corner(k);
      if (m.dot(p) < most - height || !(u.dot(p) > far)) continue;
      far = u.dot(p);
      best = k;
    }
    if (best < 0) continue;  // heights that are no numbers
    if (out.count > 0 && (out.id[at(out.count - 1)] == best || out.id[0] == best)) continue;
    out.add(centre_ + rotation_ * corner(best), best);
  }
  if (out.count < 3) return;
  // Newell's normal.
  Vector3d area = Vector3d::Zero();
  for (int k = 1; k + 1 < out.count; ++k)
    area += (out.point[at(k)] - out.point[0]).cross(out.point[at(k + 1)] - out.point[0]);
  const double length = area.norm();
  if (length > 1e-9 * size_ * size_) {
    out.normal = area / length;
    return;
  }
  // On a line: its ends.
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

void ConvexShape::flat(const Vector3d& direction, double height, Flat& out) const {
  out.count = 0;
  out.normal.setZero();
  if (kind_ == ShapeKind::box || kind_ == ShapeKind::convex) {
    // Corners of several faces are none: less of the height then.
    double h = std::max(height, kFlatAngle * thickness_);
    for (corners(direction, h, out); out.count > 3 && h > 1e-9 * size_;
         corners(direction, h, out)) {
      const double level = out.normal.dot(out.point[0]);
      double off = 0;
      for (int k = 1; k < out.count; ++k)
        off = std::max(off, std::abs(out.normal.dot(out.point[at(k)]) - level));
      if (off < 1e-6 * size_) break;
      h /= 4;
    }
    return;
  }
  if (kind_ == ShapeKind::ellipsoid || kind_ == ShapeKind::sphere)
    return out.add(farthest(direction), 0);
  const Vector3d z = rotation_.col(2);
  const double along = z.dot(direction), end = signed_one(along);
  const Vector3d across = z.cross(direction).cross(z);  // direction - along z
  const double tilt = across.norm();
  if (kind_ == ShapeKind::capsule) {
    if (std::abs(along) > std::max(kFlatAngle, height / (2 * half_.z())) || half_.z() == 0)
      return out.add(centre_ + end * half_.z() * z, end > 0 ? 1 : 0);
    out.add(centre_ - half_.z() * z, 0);
    return out.add(centre_ + half_.z() * z, 1);
  }
  const Vector3d lowest = tilt > kUpright ? Vector3d(across / tilt) : Vector3d(rotation_.col(0));
  if (tilt < std::max(kFlatAngle, height / (2 * half_.x()))) {
    out.normal = end * z;
    const Vector3d other = out.normal.cross(lowest);
    for (int k = 0; k < kRim; ++k) {
      const double angle = 2 * linalg::kPi * k / kRim;
      out.add(centre_ + half_.z() * out.normal +
                  half_.x() * (std::cos(angle) * lowest + std::sin(angle) * other),
              k);
    }
    return;
  }
  const Vector3d side = centre_ + half_.x() * lowest;
  if (std::abs(along) > std::max(kFlatAngle, height / (2 * half_.z())))
    return out.add(side + end * half_.z() * z, end > 0 ? 17 : 16);
  out.add(side - half_.z() * z, 16);
  out.add(side + half_.z() * z, 17);
}

}  // namespace tether::contact::detail
