// Tether: impacts and modes of contacts as problems of the contact library, through the joints
// (method, eq. 7, 8). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "contact_rows.hpp"
#include "shared_forces.hpp"

namespace tether::scene::event {

/// Coulomb's law, exact to round-off where the regimes that the contact library finds allow.
/// Contacts that the joints lock (A_nn = 0) carry nothing.
FrictionSolution solve_friction(const FrictionProblem& problem);

/// The same of an impact: of contacts that share their impulses all stop if the law has any
/// impulses for that; always the shortest ones. `band`: error of velocities.
FrictionSolution solve_impact(FrictionProblem problem, double band);

/// Coulomb's law for accelerations at the state that is set: w = A x - b = (a_n, a_t) where a
/// contact has no slip, and (a_n, S d + a_t) where it slides along d (else empty), S far above all
/// accelerations: the force then opposes d, whatever the accelerations are, and A stays symmetric.
/// If sliding has no forces (Painleve) the contact sticks, with x of the size of S. A bounded law
/// that slides is a force that is known.
/// Contacts that share their forces all stay at rest if the law has any forces for that, else
/// those that are `closed` stay so: the shortest forces, and then no S in w. `part`: error of the
/// accelerations.
struct AccelerationSolution {
  FrictionSolution contacts;
  double scale = 0;  ///< of the accelerations without forces
};
AccelerationSolution solve_accelerations(ContactRows& rows, const std::vector<VectorXd>& slides,
                                         double part, const std::vector<bool>& closed = {});

}  // namespace tether::scene::event
