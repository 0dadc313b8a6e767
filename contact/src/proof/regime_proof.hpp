// Tether: proofs for one island with known regimes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "proof/polish.hpp"

namespace tether::contact::detail {

/// A box that holds a solution of the equations of the candidate's regimes; none: not proven.
std::optional<Box> enclose_root(const ProofIsland& island, const Candidate& candidate);

/// The first contact for which the inequalities of its regime do not hold in the whole box, given
/// its equations; -1: none.
int first_doubt(const ProofIsland& island, const std::vector<Regime>& regimes, const Box& box);

/// A point that solves the law for b' = b - change.
struct NearbySolution {
  Box box;                      ///< it lies in here
  std::vector<Regime> regimes;  ///< of the point
  Eigen::VectorXd change;       ///< at least |b' - b|, by row
};
NearbySolution nearby_solution(const ProofIsland& island, const Candidate& candidate);

}  // namespace tether::contact::detail
