// Tether: derivatives of impacts of bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/bodies.hpp>
#include <tether/contact/body_solver.hpp>
#include <tether/contact/derivative.hpp>
#include <tether/export.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

namespace detail {
struct TETHER_HIDDEN BodyDerivativeParts;
}

/// A direction in which bodies and contacts change, or the gradient of a number with respect to
/// them. The members of each RigidBody are changes, all of the body's own units: inverse_mass is
/// d(1/m) = -dm/m^2, inverse_inertia d(I^-1) in world axes (symmetric; of a gradient, too),
/// velocity and angular_velocity those before the impact. Empty members of a direction: no change.
/// The rows J stay as they are.
struct BodyDirection {
  std::vector<RigidBody> bodies;      ///< one for each body
  std::vector<Eigen::Vector3d> bias;  ///< of each contact, in its frame
  linalg::VectorX mu;                 ///< of each contact
};

struct ImpactDirection {
  linalg::VectorX impulses;          ///< 3 for each contact, in its frame
  std::vector<Vector6d> velocities;  ///< of each body after the impact: linear, angular
  double residual = 0;               ///< as SolutionDirection::residual
};

/// The derivative of the impulses x of a contact problem of bodies and of the velocities after
/// them, v + M^-1 J'x, with A = J M^-1 J' and b = -(J v + bias). Velocities may be differentiable
/// where impulses are not unique: see DerivativeReport. Not for use by two threads at once.
class BodyDerivative {
 public:
  const DerivativeReport& report() const;
  const linalg::VectorX& impulses() const;  ///< the solution itself, in the frames of the contacts

  /// Throws std::invalid_argument on sizes that do not match and values that are not finite.
  ImpactDirection forward(const BodyDirection& direction) const;
  /// The gradient of impulses.x + sum of velocities[k].v_k after the impact for given rows. Empty:
  /// 0. A fixed body has a gradient, too, as far as contacts with bodies that move go.
  BodyDirection adjoint(const linalg::VectorView& impulses,
                        const std::vector<Vector6d>& velocities = {}) const;

 private:
  friend BodyDerivative derivative(const std::vector<RigidBody>&, const std::vector<ContactRows>&,
                                   Law, const linalg::VectorView&, const DerivativeOptions&);
  explicit BodyDerivative(std::shared_ptr<const detail::BodyDerivativeParts> parts)
      : parts_(std::move(parts)) {}
  std::shared_ptr<const detail::BodyDerivativeParts> parts_;
};

/// At `impulses`, 3 for each contact in its frame, a solution of delassus(bodies, contacts) under
/// `law`: otherwise, and on bad values, throws std::invalid_argument.
BodyDerivative derivative(const std::vector<RigidBody>& bodies,
                          const std::vector<ContactRows>& contacts, Law law,
                          const linalg::VectorView& impulses,
                          const DerivativeOptions& options = {});
/// At the impulses of a BodySolver, with its replaced contacts: contacts are to_contacts(points),
/// so that tangents are those of tangent_frame(normal).
BodyDerivative derivative(const std::vector<RigidBody>& bodies,
                          const std::vector<PointContact>& points, Law law,
                          const BodySolution& solution, const DerivativeOptions& options = {});

}  // namespace tether::contact
TETHER_EXPORT_END
