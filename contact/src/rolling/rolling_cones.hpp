// Tether: contacts with rolling friction as a product of cones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/body_solver.hpp>
#include <tether/contact/cones.hpp>
#include <vector>

namespace tether::contact::detail {

/// A contact that holds moments beside its force: |moment_t| <= rolling x_n about axes in the
/// surface, |moment_n| <= torsional x_n about the normal.
struct RollingContact {
  PointContact point;
  double rolling = 0, torsional = 0;  ///< m
  /// On `first`, world axes: where to start from, and the solution. N s, N m s.
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero(), moment = Eigen::Vector3d::Zero();
};

/// A cone for each contact, with rows in its frame: the relative velocity at the point, and the
/// relative angular velocities about the axes of its moments.
ConeProblem rolling_problem(const std::vector<RigidBody>& bodies,
                            const std::vector<RollingContact>& contacts);

/// Solves it from the impulses and moments of the contacts, which become those of the solution.
ConeSolution solve_rolling(const std::vector<RigidBody>& bodies, const Options& options,
                           std::vector<RollingContact>& contacts);

}  // namespace tether::contact::detail
