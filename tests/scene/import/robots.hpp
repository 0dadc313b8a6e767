// Tests: robots as tables of numbers, their URDF, and their mass matrix by the composite rigid body
// method (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.2), straight from the
// table. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <Eigen/Dense>
#include <string>
#include <vector>

namespace tether::scene::testing {

struct RobotLink {
  std::string name;
  int parent;        // -1: none
  std::string type;  // of the joint that carries it
  Eigen::Vector3d xyz, rpy, axis;
  double mass;
  Eigen::Vector3d centre, centre_rpy;
  Eigen::Matrix<double, 6, 1> inertia;  // xx, xy, xz, yy, yz, zz
  std::string more;                     // of the link's element
};
using Robot = std::vector<RobotLink>;

inline std::string urdf(const Robot& robot) {
  const auto numbers = [](const Eigen::Vector3d& v) {
    return fmt::format("{} {} {}", v.x(), v.y(), v.z());
  };
  std::string out = "<?xml version=\"1.0\"?>\n<robot name=\"test robot\">\n";
  for (const RobotLink& link : robot) {
    out += fmt::format("<link name=\"{}\">\n", link.name);
    const auto& J = link.inertia;
    if (link.mass > 0)
      out += fmt::format(
          "<inertial><origin xyz=\"{}\" rpy=\"{}\"/><mass value=\"{}\"/>\n<inertia ixx=\"{}\" "
          "ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>\n",
          numbers(link.centre), numbers(link.centre_rpy), link.mass, J[0], J[1], J[2], J[3], J[4],
          J[5]);
    out += link.more + "</link>\n";
    if (link.parent < 0) continue;
    out += fmt::format(
        "<joint name=\"to {0}\" type=\"{1}\"><parent link=\"{2}\"/><child link=\"{0}\"/>\n<origin "
        "xyz=\"{3}\" rpy=\"{4}\"/><axis xyz=\"{5}\"/>\n<limit lower=\"-2\" upper=\"2\" "
        "effort=\"9\" velocity=\"9\"/></joint>\n",
        link.name, link.type, robot[static_cast<std::size_t>(link.parent)].name, numbers(link.xyz),
        numbers(link.rpy), numbers(link.axis));
  }
  return out + "</robot>\n";
}

using Spatial = Eigen::Matrix<double, 6, 6>;
using Twist = Eigen::Matrix<double, 6, 1>;  // angular, linear

inline Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d out;
  out << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return out;
}

inline Eigen::Matrix3d turn(const Eigen::Vector3d& rpy) {
  const double a = rpy.x(), b = rpy.y(), c = rpy.z();
  Eigen::Matrix3d x, y, z;
  x << 1, 0, 0, 0, std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a);
  y << std::cos(b), 0, std::sin(b), 0, 1, 0, -std::sin(b), 0, std::cos(b);
  z << std::cos(c), -std::sin(c), 0, std::sin(c), std::cos(c), 0, 0, 0, 1;
  return z * y * x;
}

/// Motion transform from the parent's to the child's coordinates; R, p: the child in the parent.
inline Spatial transform(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
  Spatial X = Spatial::Zero();
  X.topLeftCorner<3, 3>() = X.bottomRightCorner<3, 3>() = R.transpose();
  X.bottomLeftCorner<3, 3>() = -R.transpose() * skew(p);
  return X;
}

/// Mass matrix of the joints that move, in the order of the table; with a free base, six rows in
/// front of them: angular and linear velocity of the first link in its own axes.
inline Eigen::MatrixXd mass_matrix(const Robot& robot, const std::vector<double>& q,
                                   bool free_base) {
  const std::size_t count = robot.size();
  std::vector<Spatial> I(count), X(count, Spatial::Identity());
  std::vector<Twist> S(count, Twist::Zero());
  std::vector<int> row(count, -1);
  int rows = free_base ? 6 : 0;
  for (std::size_t k = 0, moving = 0; k < count; ++k) {
    const RobotLink& link = robot[k];
    Eigen::Matrix3d J;
    const auto& j = link.inertia;
    J << j[0], j[1], j[2], j[1], j[3], j[4], j[2], j[4], j[5];
    const Eigen::Matrix3d R = turn(link.centre_rpy), c = skew(link.centre);
    I[k] << R * J * R.transpose() - link.mass * c * c, link.mass * c, -link.mass * c,
        link.mass * Eigen::Matrix3d::Identity();
    if (link.parent < 0) continue;
    Eigen::Matrix3d turned = turn(link.rpy);
    Eigen::Vector3d at = link.xyz;
    const Eigen::Vector3d axis = link.axis.normalized();
    if (link.type != "fixed") {
      const double way = q[moving++];
      row[k] = rows++;
      if (link.type == "prismatic") {
        S[k] << Eigen::Vector3d::Zero(), axis;
        at += turned * (way * axis);
      } else {
        S[k] << axis, Eigen::Vector3d::Zero();
        const Eigen::Matrix3d K = skew(axis);  // Rodrigues' formula
        turned = turned *
                 (Eigen::Matrix3d::Identity() + std::sin(way) * K + (1 - std::cos(way)) * K * K);
      }
    }
    X[k] = transform(turned, at);
  }
  for (std::size_t k = count; k-- > 1;) {
    const Spatial carried = X[k].transpose() * I[k] * X[k];
    I[static_cast<std::size_t>(robot[k].parent)] += carried;
  }
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(rows, rows);
  if (free_base) M.topLeftCorner<6, 6>() = I[0];
  for (std::size_t k = 1; k < count; ++k) {
    if (row[k] < 0) continue;
    Twist F = I[k] * S[k];
    M(row[k], row[k]) = S[k].dot(F);
    for (std::size_t up = k; robot[up].parent >= 0;) {
      F = (X[up].transpose() * F).eval();
      up = static_cast<std::size_t>(robot[up].parent);
      if (row[up] >= 0) M(row[k], row[up]) = M(row[up], row[k]) = F.dot(S[up]);
    }
    if (free_base) M.col(row[k]).head<6>() = F, M.row(row[k]).head<6>() = F.transpose();
  }
  return M;
}

/// Seven axes, none of them along an edge of its link, a tool welded to a flange without mass, and
/// fingers that slide.
inline Robot arm() {
  const auto J = [](double a, double b, double c, double d, double e, double f) {
    Eigen::Matrix<double, 6, 1> out;
    out << a, b, c, d, e, f;
    return out;
  };
  const Eigen::Vector3d o = Eigen::Vector3d::Zero(), z = Eigen::Vector3d::UnitZ();
  return {
      {"base", -1, "", o, o, z, 4, {0, 0, 0.05}, o, J(0.02, 0, 0, 0.02, 0, 0.03), ""},
      {"shoulder",
       0,
       "revolute",
       {0, 0, 0.3},
       {0, 0, 0.2},
       z,
       3.7,
       {0.01, -0.03, 0.04},
       {0.1, 0.2, -0.3},
       J(0.02, 0.001, -0.002, 0.018, 0.003, 0.012),
       ""},
      {"upper arm",
       1,
       "revolute",
       {0, 0.02, 0.1},
       {-1.5707963, 0, 0},
       {0.1, 0, 1},
       3.1,
       {0.02, -0.11, 0.03},
       {0, 0.4, 0},
       J(0.03, 0.002, 0.001, 0.011, -0.001, 0.031),
       ""},
      {"elbow",
       2,
       "continuous",
       {0.01, -0.31, 0},
       {1.57, 0.1, 0},
       {0, 0, -2},
       2.6,
       {0, 0.03, 0.08},
       o,
       J(0.017, 0, 0.001, 0.016, 0.002, 0.006),
       ""},
      {"forearm",
       3,
       "revolute",
       {0.08, 0, 0.1},
       {1.57, 0, 0.3},
       {0.2, 0.3, 1},
       2.2,
       {-0.04, 0.1, 0.02},
       {0.2, -0.2, 0.9},
       J(0.018, -0.002, 0.001, 0.008, 0.001, 0.016),
       ""},
      {"wrist 1",
       4,
       "revolute",
       {-0.08, 0.38, 0},
       {-1.57, 0, 0},
       z,
       1.3,
       {0.01, 0.02, -0.05},
       o,
       J(0.006, 0, 0.0003, 0.005, -0.0004, 0.003),
       ""},
      {"wrist 2",
       5,
       "revolute",
       {0, 0, 0.01},
       {1.5, 0, 0.4},
       {0, 1, 1},
       1.1,
       {0.06, 0.01, 0.01},
       {0.3, 0, 0},
       J(0.002, 0.0001, 0, 0.004, 0, 0.004),
       ""},
      {"wrist 3",
       6,
       "revolute",
       {0.088, 0, 0},
       {1.57, 0, 0},
       z,
       0.7,
       {0.01, 0.01, 0.08},
       o,
       J(0.0012, 0, 0.0001, 0.001, 0.0001, 0.0009),
       ""},
      {"flange", 7, "fixed", {0, 0, 0.1}, {0, 0, 0.785}, z, 0, o, o, J(0, 0, 0, 0, 0, 0), ""},
      {"hand",
       8,
       "fixed",
       {0, 0.01, 0.02},
       {0.1, 0, -0.785},
       z,
       0.6,
       {0, 0.01, 0.03},
       {0, 0.2, 0.1},
       J(0.001, 0, 0, 0.0024, 0, 0.0019),
       ""},
      {"finger",
       9,
       "prismatic",
       {0, 0.01, 0.06},
       {0, 0.2, 0},
       {0, 1, 0.2},
       0.05,
       {0, 0.01, 0.02},
       o,
       J(2e-5, 0, 1e-6, 2e-5, 0, 1e-5),
       ""},
      {"other finger",
       9,
       "prismatic",
       {0, -0.01, 0.06},
       {0, 0.2, 3.1},
       {0, 1, 0},
       0.05,
       {0, 0.01, 0.02},
       o,
       J(2e-5, 0, 1e-6, 2e-5, 0, 1e-5),
       ""},
  };
}

/// A trunk with a head, two arms and two legs, which touch by spheres at the feet.
inline Robot walker() {
  const auto J = [](double a, double b, double c) {
    Eigen::Matrix<double, 6, 1> out;
    out << a, 0.02 * a, -0.01 * b, b, 0.03 * b, c;
    return out;
  };
  const Eigen::Vector3d o = Eigen::Vector3d::Zero(), x = Eigen::Vector3d::UnitX(),
                        y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  Robot out{
      {"trunk", -1, "", o, o, z, 12, {0.01, 0, 0.1}, {0, 0.1, 0}, J(0.3, 0.28, 0.12), ""},
      {"head", 0, "revolute", {0, 0, 0.4}, o, z, 2, {0.02, 0, 0.08}, o, J(0.01, 0.012, 0.009), ""}};
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "right " : "left ";
    const int hip = static_cast<int>(out.size());
    out.push_back({name + "hip",
                   0,
                   "revolute",
                   {0, 0.1 * side, -0.1},
                   o,
                   x,
                   1.1,
                   {0, 0.01, 0},
                   o,
                   J(0.003, 0.002, 0.003),
                   ""});
    out.push_back({name + "thigh",
                   hip,
                   "revolute",
                   {0, 0.03 * side, 0},
                   {0.1 * side, 0, 0},
                   y,
                   2.5,
                   {0.01, 0, -0.17},
                   {0.1, 0, 0.2},
                   J(0.03, 0.031, 0.006),
                   ""});
    out.push_back({name + "shin",
                   hip + 1,
                   "revolute",
                   {0, 0, -0.36},
                   o,
                   {0, 1, 0.1},
                   1.5,
                   {0, 0, -0.15},
                   o,
                   J(0.02, 0.019, 0.003),
                   ""});
    out.push_back({name + "foot",
                   hip + 2,
                   "fixed",
                   {0, 0, -0.34},
                   {0, 0.1, 0},
                   z,
                   0.4,
                   {0.03, 0, -0.02},
                   o,
                   J(0.0005, 0.001, 0.001),
                   "<collision><origin xyz=\"0.1 0 0\"/><geometry><sphere "
                   "radius=\"0.04\"/></geometry></collision>\n<collision><origin xyz=\"-0.05 0 "
                   "0\"/><geometry><sphere radius=\"0.04\"/></geometry></collision>\n"});
    out.push_back({name + "arm",
                   0,
                   "continuous",
                   {0, 0.2 * side, 0.3},
                   {0, 0, 0.2 * side},
                   y,
                   1.4,
                   {0, 0.02, -0.2},
                   o,
                   J(0.02, 0.019, 0.002),
                   ""});
  }
  return out;
}

}  // namespace tether::scene::testing
