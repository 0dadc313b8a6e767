// Tether: the bodies behind a Delassus matrix. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/problem.hpp>

#include "problem/body_form.hpp"

namespace tether::contact::detail {

/// Whether factors by bodies may be smaller than A: its contacts are twice as many as the pairs of
/// bodies that touch. In the plane, where a contact has a velocity of its own, they are not.
bool may_have_bodies(const Problem& problem);

/// Factors A = H H' of a problem that is given by its matrix alone, with a few columns for each
/// body; null where A is not positive semidefinite.
///
/// Contacts between the same two bodies have the same column pattern: they are a class. Two bodies
/// have six relative velocities, so that a few rows of a class determine the others. On these rows
/// a block Cholesky decomposition eliminates one class after another. A class that alone couples a
/// body to what has gone before, as contacts with the ground do at first, takes the whole body
/// away, and nothing fills in.
std::shared_ptr<const BodyForm> bodies_of_matrix(const Problem& problem);

}  // namespace tether::contact::detail
