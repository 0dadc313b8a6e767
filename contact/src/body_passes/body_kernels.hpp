// Tether: passes over contacts between bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "kernels/body_contacts.hpp"

namespace tether::contact::detail {

// coupled = null: one pass of Gauss-Seidel; returns |D dx|^2, D the diagonal block. Otherwise
// nothing changes, and the errors |theta D dx|^2 of the contacts are returned (method, section 3),
// coupled: theta of each.
Squares pass(const BodyArrays& s, Law law, GeneralContact* begin, GeneralContact* end, Coupled);
Squares pass(const BodyArrays& s, Law, SphereContact* begin, SphereContact* end, Coupled);
Squares pass(const BodyArrays& s, Law, SmoothContact* begin, SmoothContact* end, Coupled);
// The same over groups of four.
Squares pass(const BodyArrays& s, Law law, GeneralGroup* begin, GeneralGroup* end, Coupled);
Squares pass(const BodyArrays& s, Law, SphereGroup* begin, SphereGroup* end, Coupled);
bool groups_are_served();  // false: this machine has no code for groups

}  // namespace tether::contact::detail
