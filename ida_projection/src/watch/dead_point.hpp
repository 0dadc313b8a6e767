// Tether: multipliers that F does not determine (method, section 13). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <string>

#include "start/algebraic.hpp"
#include "watch/row_faults.hpp"

namespace tether::ida_projection {

/// Names algebraic variables that F does not determine at y (contiguous), because its derivatives
/// by them are dependent. Newton's matrix is then singular in every form of F: at singular
/// positions, and where joints are given twice. Names the rows of which the same is true, too.
/// Empty: there are none, or it is not known.
std::string undetermined_multipliers(const Candidate& candidate, N_Vector y,
                                     const AlgebraicVariables& variables, Corrector& corrector,
                                     RowFaults& faults, Statistics& statistics);

}  // namespace tether::ida_projection
