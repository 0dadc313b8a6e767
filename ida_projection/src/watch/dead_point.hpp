// Tether: multipliers that F does not determine (method, section 13). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <string>

#include "host/corrector.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// Do the derivatives of F by algebraic variables depend on each other at y, contiguous? Then F
/// does not determine these in any form of it, and Newton's matrix is singular: at singular
/// positions, where joints depend on each other, and where some are there twice. Names them and the
/// rows of which that is true; empty: none, or not known.
std::string undetermined_multipliers(const Candidate& candidate, N_Vector y,
                                     const AlgebraicVariables& variables, Corrector& corrector,
                                     const Constraints& constraints, Statistics& statistics);

}  // namespace tether::ida_projection
