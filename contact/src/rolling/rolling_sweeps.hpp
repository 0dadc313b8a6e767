// Tether: sweeps over contacts with rolling friction. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/rolling.hpp>
#include <vector>

#include "rolling/rolling_block.hpp"

namespace tether::contact::detail {

/// Block Gauss-Seidel on the velocities of the bodies. Keeps its storage.
class RollingSweeps {
 public:
  /// Contacts of islands that have nothing in common with others.
  void begin(const std::vector<RigidBody>& bodies, const std::vector<RollingContact>& contacts);
  void solve(double tolerance, int min_sweeps, int max_sweeps);
  /// Impulses and moments in world axes, on `first`; begin() has set them to 0.
  void set(int contact, const Eigen::Vector3d& impulse, const Eigen::Vector3d& moment);
  double residual() const;

  Eigen::Vector3d impulse(int contact) const;
  Eigen::Vector3d moment(int contact) const;
  Regime regime(int contact) const;
  const Vector6d& velocity(int body) const { return velocity_[static_cast<std::size_t>(body)]; }
  Status status = Status::solved;
  double error = 0;
  int sweeps = 0;

 private:
  struct Row {
    int first, second;  // second -1: the world
    Eigen::Matrix3d frame;
    Eigen::Vector3d r1, r2;
    double bias, length;
    Eigen::Matrix<double, 6, 6> move1, move2;  // M^-1 J' of both bodies
    RollingBlock block;
    Vector6d x;
  };

  bool solve_together(double tolerance);
  Vector6d relative(const Row& row) const;
  void push(const Row& row, const Vector6d& impulse);

  std::vector<Row> rows_;
  std::vector<Vector6d> velocity_;
  double scale_ = 0;
};

}  // namespace tether::contact::detail
