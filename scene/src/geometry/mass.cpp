// Tether: volume, centre and inertia of shapes. SPDX-License-Identifier: BSD-3-Clause
#include "shape_type.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/symmetric_eigen.hpp>

namespace tether::scene {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Sums over tetrahedra with one corner at the origin: volume, first and second moments.
struct Moments {
  double volume = 0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();

  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const double v = a.dot(b.cross(c)) / 6;
    const Vector3d s = a + b + c;
    volume += v;
    first += v / 4 * s;
    second +=
        v / 20 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
  }
};

}  // namespace

Matrix3d point_inertia(const Vector3d& d) {
  return d.squaredNorm() * Matrix3d::Identity() - d * d.transpose();
}

// Turning by the identity would only add rounding.
Matrix3d rotated(const Matrix3d& R, const Matrix3d& inertia) {
  if (R == Matrix3d::Identity()) return inertia;
  const Matrix3d out = R * inertia * R.transpose();
  return (out + out.transpose()) / 2;
}

MassProperties within(const std::vector<Vector3d>& points,
                      const std::vector<std::vector<std::size_t>>& faces) {
  Vector3d origin = Vector3d::Zero();
  for (const Vector3d& p : points) origin += p / static_cast<double>(points.size());
  std::vector<Vector3d> p;
  double size = 0;
  for (const Vector3d& each : points) {
    p.emplace_back(each - origin);
    size = std::max(size, p.back().norm());
  }
  if (!(size > 0) || !std::isfinite(size)) return {};
  for (Vector3d& each : p) each /= size;  // nothing below overflows

  Moments sum;
  for (const std::vector<std::size_t>& face : faces)
    for (std::size_t m = 1; m + 1 < face.size(); ++m)
      sum.add(p[face[0]], p[face[m]], p[face[m + 1]]);
  if (!(sum.volume > 1e-12)) return {};
  MassProperties out;
  const double cube = size * size * size;
  const Vector3d centre = sum.first / sum.volume;
  const Matrix3d second = sum.second - sum.volume * centre * centre.transpose();
  out.volume = sum.volume * cube;
  out.centre = origin + centre * size;
  out.inertia = (second.trace() * Matrix3d::Identity() - second) * (cube * size * size);
  return out;
}

MassProperties along_axes(double volume, const Vector3d& lengths, double part) {
  const Vector3d s = lengths.cwiseProduct(lengths) / part;
  return {volume, Vector3d::Zero(),
          volume * Vector3d(s.y() + s.z(), s.x() + s.z(), s.x() + s.y()).asDiagonal()};
}

MassProperties mass_properties(const Shape& shape) {
  MassProperties out = type_of(shape.kind).solid(shape);
  if (!(out.volume > 0)) return {};
  const Matrix3d R = shape.orientation.toRotationMatrix();
  out.inertia = rotated(R, out.inertia);
  out.centre = R * out.centre + shape.position;
  return out;
}

MassProperties mass_properties(const std::vector<Shape>& shapes) {
  MassProperties all;
  std::vector<MassProperties> parts;
  for (const Shape& shape : shapes) {
    const MassProperties part = mass_properties(shape);
    if (!(part.volume > 0)) continue;
    parts.push_back(part);
    all.volume += part.volume;
    all.centre += part.volume * part.centre;
  }
  if (parts.empty()) return all;
  if (parts.size() == 1) return parts.front();
  all.centre /= all.volume;
  for (const MassProperties& part : parts)
    all.inertia += part.inertia + part.volume * point_inertia(part.centre - all.centre);
  return all;
}

bool is_inertia(const Matrix3d& inertia, bool inside) {
  if (!inertia.allFinite()) return false;
  const double scale = inertia.cwiseAbs().maxCoeff();
  if (!(scale > (inside ? 1e-300 : 0))) return false;
  const Vector3d moment = linalg::symmetric_eigenvalues(inertia / scale);  // ascending
  return moment[0] > (inside ? 1e-13 : 0) &&
         moment[2] <= (moment[0] + moment[1]) * (1 + (inside ? 0.5e-9 : 1e-9));
}

}  // namespace tether::scene
