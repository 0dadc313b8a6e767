// Tether: what both formats of robots say alike. SPDX-License-Identifier: BSD-3-Clause
#include "import/robot/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/symmetric_eigen.hpp>

namespace tether::scene::import {

Eigen::Quaterniond from_rpy(const Eigen::Vector3d& rpy) {
  return Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
}

Eigen::Isometry3d placed(const Eigen::Quaterniond& orientation, const Eigen::Vector3d& position) {
  Eigen::Isometry3d out = Eigen::Isometry3d::Identity();
  out.linear() = orientation.toRotationMatrix();
  out.translation() = position;
  return out;
}

Eigen::Matrix3d mended_inertia(const Eigen::Matrix3d& inertia) {
  const double scale = inertia.cwiseAbs().maxCoeff();
  const linalg::SymmetricEigen<3> eigen = linalg::symmetric_eigen(inertia / scale);
  Eigen::Vector3d moment = eigen.values;
  moment = moment.cwiseMax(1e-6 * moment[2]);
  const double lacking = std::max(0.0, moment[2] * (1 + 1e-9) - moment[0] - moment[1]);
  moment[0] += lacking / 2;
  moment[1] += lacking / 2;
  const Eigen::Matrix3d out = eigen.vectors * moment.asDiagonal() * eigen.vectors.transpose();
  return scale / 2 * (out + out.transpose());
}

void add_mass(double mass, const Eigen::Vector3d& centre, const Eigen::Matrix3d& inertia,
              double& total, Eigen::Vector3d& common, Eigen::Matrix3d& sum) {
  const auto about = [](double m, const Eigen::Vector3d& d) {
    return Eigen::Matrix3d(m * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose()));
  };
  sum += inertia;
  if (!(mass > 0)) return;
  if (!(total > 0)) {
    total = mass;
    common = centre;
    return;
  }
  const Eigen::Vector3d now = (total * common + mass * centre) / (total + mass);
  sum += about(total, common - now) + about(mass, centre - now);
  total += mass;
  common = now;
}

}  // namespace tether::scene::import
