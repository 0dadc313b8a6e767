// Tether: impulses brought to rounding, and their regimes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "proof/island.hpp"

namespace tether::contact::detail {

/// Impulses near a solution and the regimes that they are in; those that separate have x = 0.
struct Candidate {
  Eigen::VectorXd x;
  std::vector<Regime> regimes;
};

/// Newton's method on the regimes' equations from the island's impulses. Nothing is promised: the
/// proof judges what comes out.
Candidate polish(const ProofIsland& island);

}  // namespace tether::contact::detail
