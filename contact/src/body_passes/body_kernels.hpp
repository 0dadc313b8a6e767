// Tether: passes over contacts between bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "kernels/body_contacts.hpp"

namespace tether::contact::detail {

// One pass of Gauss-Seidel; returns |D dx|^2, D the diagonal block.
Squares sweep(const BodyArrays& s, Law law, GeneralContact* begin, GeneralContact* end);
Squares sweep(const BodyArrays& s, Law, SphereContact* begin, SphereContact* end);
Squares sweep(const BodyArrays& s, Law, SmoothContact* begin, SmoothContact* end);

// Changes nothing; the errors |theta D dx|^2 of the contacts (method, section 3). coupled: theta of
// each contact.
Squares test(const BodyArrays& s, Law law, GeneralContact* begin, GeneralContact* end, Coupled);
Squares test(const BodyArrays& s, Law, SphereContact* begin, SphereContact* end, Coupled);
Squares test(const BodyArrays& s, Law, SmoothContact* begin, SmoothContact* end, Coupled);

// Groups of four; false: this machine has no code for them.
bool groups_are_served();
Squares sweep(const BodyArrays& s, Law law, GeneralGroup* begin, GeneralGroup* end);
Squares sweep(const BodyArrays& s, Law, SphereGroup* begin, SphereGroup* end);
Squares test(const BodyArrays& s, Law law, GeneralGroup* begin, GeneralGroup* end, Coupled);
Squares test(const BodyArrays& s, Law, SphereGroup* begin, SphereGroup* end, Coupled);

}  // namespace tether::contact::detail
