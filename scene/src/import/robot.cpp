// Tether: what both formats of robots say alike. SPDX-License-Identifier: BSD-3-Clause
#include "robot.hpp"

#include <fmt/format.h>

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

namespace {

constexpr std::size_t kMostNames = 10000;  // of a line

}  // namespace

void Remarks::add(const std::string& what, const std::string& name) {
  const auto [found, is_new] = index_.emplace(what, lines_.size());
  if (is_new) lines_.push_back({what, {}, 0});
  Line& line = lines_[found->second];
  ++line.count;
  if (!name.empty() && line.names.size() < kMostNames) line.names.push_back(name);
}

std::vector<std::string> Remarks::lines() const {
  std::vector<std::string> out;
  for (const Line& line : lines_) {
    std::vector<std::string> names = line.names;
    sort_unique(names);
    if (!names.empty())
      out.push_back(fmt::format("{}: {}{}", line.what, fmt::join(names, ", "),
                                line.names.size() < kMostNames ? "" : ", ..."));
    else
      out.push_back(line.count > 1 ? fmt::format("{} ({} times)", line.what, line.count)
                                   : line.what);
  }
  return out;
}

}  // namespace tether::scene::import
