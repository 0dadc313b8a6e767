// Tether: energy and momenta that the projection keeps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dimensions.hpp"
#include "mechanics/force.hpp"
#include "smooth/rows/moving_bodies.hpp"

namespace tether::scene::smooth {

using Forces = std::vector<std::unique_ptr<Force>>;
/// A Jacobian of constraints, in the storage of the projection.
using ConstraintRows =
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

/// Values at the state that is set, minus those at the start. Work of forces without potential is
/// an unknown: energy minus work is kept.
class KeptInvariants {
 public:
  /// `work` is the index of the unknown in y. Throws std::invalid_argument, naming what changes an
  /// invariant from outside.
  KeptInvariants(const Scene& scene, const MovingBodies& bodies, const Forces& forces, int work);

  int count() const { return static_cast<int>(kept_.size()); }
  bool has_work() const { return has_work_; }
  /// Values at the start, to save and to set.
  std::vector<double>& kept() { return kept_; }
  /// Keeps those of the state that is set from now on.
  void keep(double t, const double* y);

  double energy() const;
  void values(double t, const double* y, double* g) const;
  void jacobian(ConstraintRows C, int row) const;
  void add_names(std::vector<std::string>& names) const;
  /// Unit of each value in SI.
  std::vector<double> units(const Units& units) const;

 private:
  const MovingBodies& bodies_;
  const Forces& forces_;
  int work_;
  bool has_work_ = false, energy_ = false, momentum_ = false;
  Eigen::Matrix<double, Eigen::Dynamic, 3> axes_;  // of angular momentum about the origin
  Vector3d steady_force_ = Vector3d::Zero();       // momentum grows by it
  std::vector<double> kept_;
};

}  // namespace tether::scene::smooth
