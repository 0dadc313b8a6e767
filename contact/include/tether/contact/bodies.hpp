// Tether: contact problems given by bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/problem.hpp>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// On the six velocities of a body: linear, then angular.
using Matrix6d = linalg::Matrix<6, 6>;
/// Linear, then angular.
using Vector6d = linalg::Matrix<6, 1>;
/// From the six velocities of a body to three of a contact.
using Matrix36d = linalg::Matrix<3, 6>;

/// Rigid body at one instant: mass and inertia about its centre of mass, in world axes, and the
/// velocity before the impulses. Zero inverse mass and inertia: fixed (its velocity may be
/// prescribed and is not changed).
struct RigidBody {
  double inverse_mass = 0;                                     ///< 1/kg
  Eigen::Matrix3d inverse_inertia = Eigen::Matrix3d::Zero();   ///< 1/(kg m^2)
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< of the centre, m/s
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< rad/s

  /// Not fixed: an impulse changes its velocity.
  bool moves() const { return inverse_mass > 0 || !inverse_inertia.isZero(0); }
  /// M^-1 of the six velocities (linear, angular).
  Matrix6d inverse_mass_matrix() const;
  /// Linear (m/s), then angular (rad/s).
  Vector6d velocities() const;
  /// The reverse of velocities().
  void set_velocities(const Vector6d& v);
};

/// The rows of one contact: relative velocity J1 v1 + J2 v2 in the contact frame (normal, tangent,
/// tangent), positive normal: the bodies separate. `bias` is added to it before the solve: w = J v
/// + bias. Where a contact is of rigid bodies that touch at a point, PointContact says the same by
/// geometry; rows are for any Jacobian.
struct ContactRows {
  int first = 0, second = -1;  ///< indices of bodies; -1: the fixed world
  Matrix36d J1 = Matrix36d::Zero(), J2 = Matrix36d::Zero();  ///< on `first`, on `second`
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();            ///< m/s
  double mu = 0;                                             ///< coefficient of friction, >= 0

  /// Touching at r1 from the centre of `first` and r2 from that of `second`; the unit normal
  /// points from `second` to `first`. The first tangent is chosen; see tangent_frame.
  static ContactRows at_point(int first, int second, const Eigen::Vector3d& r1,
                              const Eigen::Vector3d& r2, const Eigen::Vector3d& normal, double mu);
};

/// Rows: the unit `normal`, tangent, tangent (right-handed, unit).
Eigen::Matrix3d tangent_frame(const Eigen::Vector3d& normal);

/// Forms A = J M^-1 J' and b = -(J v + bias). Throws std::invalid_argument on indices that do not
/// exist, values that are not finite, and contacts between fixed bodies.
Problem delassus(const std::vector<RigidBody>& bodies, const std::vector<ContactRows>& contacts);

/// Velocities after the impulses, of each body: v + M^-1 J' x. `impulses`: three of each contact in
/// its frame, N s.
std::vector<Vector6d> velocities_after(const std::vector<RigidBody>& bodies,
                                       const std::vector<ContactRows>& contacts,
                                       const linalg::VectorView& impulses);

}  // namespace tether::contact
TETHER_EXPORT_END
