// Tether: does the caller's id vector agree with F? SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <iterator>

#include "host/shortest.hpp"
#include "start/algebraic.hpp"
#include "start/nearby_residuals.hpp"

namespace tether::ida_projection {

const std::string& AlgebraicVariables::doubts(const Candidate& candidate, Corrector& corrector,
                                              double cj) {
  if (found_.judged_id || candidate.base_entries == nullptr) return found_.doubts;
  found_.judged_id = true;
  std::string& text = found_.doubts;
  std::vector<int> moving = with_derivative(candidate, corrector, cj);
  if (!moving.empty())
    text = "the id vector calls " + listed(moving) +
           " algebraic, but F contains the derivative: 1 stands for differential variables, 0 for "
           "algebraic ones (Options::id)";
  if (!found_.without_derivative.empty())
    text += (text.empty() ? "the id vector calls " : "; it calls ") +
            listed(found_.without_derivative) +
            " differential, but F does not contain the derivative: 0 stands for algebraic "
            "variables (Options::id)";
  return text;
}

// Those called algebraic whose y' F notices; all of them are changed at once first.
std::vector<int> AlgebraicVariables::with_derivative(const Candidate& candidate,
                                                     Corrector& corrector, double cj) const {
  if (mask() == nullptr) return {};
  const auto size = static_cast<std::size_t>(N_VGetLength(candidate.base));
  std::vector<int> algebraic;
  for (std::size_t j = 0; j < size; ++j)
    if (mask()[j] == 0.0) algebraic.push_back(static_cast<int>(j));
  std::vector<char> noticed(size, 0);
  for (const double sign : {1.0, -0.37}) {
    NearbyResiduals near(candidate, corrector, statistics_,
                         NearbyResiduals::irregular_changes(candidate, cj, sign));
    near.notices(algebraic, NearbyResiduals::Of::rates, noticed);
  }
  if (std::count(noticed.begin(), noticed.end(), 1) == 0) return {};
  AlgebraicVariables derived(statistics_);
  std::vector<int> moving;
  if (!derived.derive(candidate, corrector, cj).empty()) return moving;
  std::copy_if(algebraic.begin(), algebraic.end(), std::back_inserter(moving),
               [&](int j) { return derived.mask() == nullptr || derived.mask()[j] != 0.0; });
  return moving;
}

}  // namespace tether::ida_projection
