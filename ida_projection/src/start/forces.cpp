// Tether: does F move unknowns as forces move bodies? SPDX-License-Identifier: BSD-3-Clause
#include "start/forces.hpp"

#include <cmath>

#include "start/nearby_residuals.hpp"

namespace tether::ida_projection {

namespace {

bool meet(const std::vector<char>& a, const std::vector<char>& b) {
  for (std::size_t i = 0; i < a.size(); ++i)
    if (a[i] != 0 && b[i] != 0) return true;
  return false;
}

}  // namespace

bool are_forces(const RowChain& chain, const Candidate& candidate, Corrector& corrector, double cj,
                Statistics& statistics) {
  if (candidate.base_entries == nullptr || !(std::abs(cj) > 0.0)) return false;
  using Of = NearbyResiduals::Of;
  NearbyResiduals near(candidate, corrector, statistics,
                       NearbyResiduals::irregular_changes(candidate, cj, 1.0));
  bool known = true;
  const auto equations_with = [&](const std::vector<int>& unknowns, Of what) {
    std::vector<char> equations(static_cast<std::size_t>(N_VGetLength(candidate.base)), 0);
    known = near.notices(unknowns, what, equations) && known;
    return equations;
  };
  const std::vector<char> own = equations_with(chain.forces, Of::rates);
  const auto equations_for = [&](const std::vector<int>& unknowns) {
    std::vector<char> equations = equations_with(unknowns, Of::rates);
    for (std::size_t i = 0; i < own.size(); ++i) equations[i] = own[i] != 0 ? 0 : equations[i];
    return equations;
  };
  const std::vector<char> positions = equations_for(chain.positions);
  for (const std::vector<int>& group : chain.velocities_of_rows)
    if (!meet(equations_with(group, Of::values), positions)) return false;
  if (meet(equations_with(chain.forces, Of::values), positions)) return false;
  const std::vector<char> velocities = equations_for(chain.velocities);
  for (const std::vector<int>& group : chain.forces_of_rows)
    if (!meet(equations_with(group, Of::values), velocities)) return false;
  return known;
}

}  // namespace tether::ida_projection
