// Tether: contacts with rolling and torsional friction. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/body_solver.hpp>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Moments that a contact can hold beside its forces, as lengths: |moment_t| <= rolling x_n about
/// axes in the surface, |moment_n| <= torsional x_n about the normal.
struct RollingContact {
  PointContact point;
  double rolling = 0;    ///< m, >= 0
  double torsional = 0;  ///< m, >= 0
};

/// Six rows a contact (README, section 19), with v = J_v v + bias n the relative velocity at the
/// point and w = w1 - w2 the relative angular velocity:
///
///     x_n >= 0 complementary to v_n >= 0,   -v_t in the normal cone of |x_t| <= mu x_n at x_t,
///     -w_n in that of |y_n| <= torsional x_n at y_n,   -w_t in that of |y_t| <= rolling x_n at y_t
///
/// Coulomb's law with its twins for moments: each part of impulse x and moment y opposes its own
/// velocity.
struct RollingProblem {
  std::vector<RigidBody> bodies;
  std::vector<RollingContact> contacts;
};

struct RollingSolution {
  Status status = Status::unsolved;
  double error = Residuals::kNone;  ///< see rolling_residual
  int sweeps = 0;
  std::vector<Eigen::Vector3d> impulses, moments;  ///< world axes, on `first`, N s and N m s
  std::vector<Vector6d> velocities;                ///< linear, angular; after the impulses
};

/// Block Gauss-Seidel; each block to round-off. Throws std::invalid_argument on values that are not
/// finite or negative and indices that do not exist.
RollingSolution solve(const RollingProblem& problem, double tolerance = 1e-9,
                      int max_sweeps = 1000);

/// Largest residual of the natural map of a contact, x - P(x - D^-1 w) times D for each part, as a
/// velocity (moments by the length at which they move as much as forces), over the largest velocity
/// that a contact needs. 0: the law holds.
double rolling_residual(const RollingProblem& problem, const std::vector<Eigen::Vector3d>& impulses,
                        const std::vector<Eigen::Vector3d>& moments);

}  // namespace tether::contact
TETHER_EXPORT_END
