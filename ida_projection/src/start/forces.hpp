// Tether: does F move unknowns as forces move bodies? SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/statistics.hpp>

#include "host/corrector.hpp"
#include "rows/row_chain.hpp"

namespace tether::ida_projection {

/// Equations of F for the rates of positions contain velocities and no forces, those for the rates
/// of velocities contain forces. Each of the chain's groups is asked by itself. Some 20
/// evaluations of F near the candidate, on contiguous vectors; its equations for the forces' own
/// rates, which may contain anything, do not count.
bool are_forces(const RowChain& chain, const Candidate& candidate, Corrector& corrector, double cj,
                Statistics& statistics);

}  // namespace tether::ida_projection
