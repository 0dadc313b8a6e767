// Tether: which variables are algebraic. SPDX-License-Identifier: BSD-3-Clause
#include "start/algebraic.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "rows/column_search.hpp"
#include "start/nearby_residuals.hpp"

namespace tether::ida_projection {

void AlgebraicVariables::set(N_Vector id) {
  if (!id_) id_ = OwnedVector(id);
  if (static_cast<N_Vector>(id_) != id) N_VScale(1.0, id, id_);
  if (!is_contiguous(id_)) {
    any_ = N_VMin(id_) == 0.0;
    return;
  }
  const double* mask = N_VGetArrayPointer(id_);
  const auto size = static_cast<std::ptrdiff_t>(N_VGetLength(id_));
  const auto algebraic = std::count(mask, mask + size, 0.0);
  any_ = algebraic > 0;
  all_ = algebraic == size;
}

namespace {

// Whether no row changes when all columns change at once that changed none alone.
bool others_are_silent(const std::vector<char>& filled, const ColumnSearch::Probe& probe) {
  std::vector<int> others;
  for (std::size_t j = 0; j < filled.size(); ++j)
    if (!filled[j]) others.push_back(static_cast<int>(j));
  std::vector<char> changed(filled.size(), 0);
  return others.empty() ||
         (probe(others, changed) && std::count(changed.begin(), changed.end(), 1) == 0);
}

}  // namespace

// Component j is algebraic if no bit of F changes with y'_j. ColumnSearch changes many y' at once
// and finds the columns that change F. A change of another size, of all other columns at once,
// confirms that these do not.
std::string AlgebraicVariables::derive(const Candidate& candidate, Corrector& corrector,
                                       double cj) {
  if (candidate.base_entries == nullptr) return "vectors without contiguous memory";
  const int size = static_cast<int>(N_VGetLength(candidate.base));
  using Near = NearbyResiduals;
  Near small(candidate, corrector, statistics_, Near::irregular_changes(candidate, cj, 1.0)),
      large(candidate, corrector, statistics_, Near::irregular_changes(candidate, cj, -1e3, 3.3));
  bool by_small = small.known(), by_large = large.known() && !by_small;
  const auto probe = [&](const std::vector<int>& columns, std::vector<char>& changed) {
    bool evaluated = false;  // F may fail at one size; the other one decides then
    if (by_small) evaluated = small.notices(columns, Near::Of::rates, changed);
    if (by_large) evaluated = large.notices(columns, Near::Of::rates, changed) || evaluated;
    return evaluated;
  };
  std::vector<char> filled;
  constexpr long most = 4L * kLargestProbed;
  const auto search = [&](long probes) {
    return ColumnSearch(size, size, probe, probes).run(&filled);
  };
  auto outcome = search(most / 2);
  if (small.known() && large.known()) {
    std::swap(by_small, by_large);
    if (outcome == ColumnSearch::Outcome::refused ||
        (outcome == ColumnSearch::Outcome::found && !others_are_silent(filled, probe))) {
      by_small = by_large = true;
      outcome = search(most / 4);
    }
  }
  if (outcome == ColumnSearch::Outcome::refused) return "F could not be evaluated at other y'";
  if (outcome != ColumnSearch::Outcome::found)
    return "that takes more than " + std::to_string(most) + " evaluations of F";
  OwnedVector id(candidate.base);
  for (std::size_t j = 0; j < filled.size(); ++j) N_VGetArrayPointer(id)[j] = filled[j] ? 1.0 : 0.0;
  set(id);
  return {};
}

std::vector<char> AlgebraicVariables::derivative_free_equations(const Candidate& candidate,
                                                                Corrector& corrector,
                                                                double cj) const {
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
  std::vector<int> all(n);
  std::iota(all.begin(), all.end(), 0);
  std::vector<char> noticed(n, 0);
  bool known = false;
  for (const double size : {1.0, -0.37}) {  // F may fail at one of them
    NearbyResiduals near(candidate, corrector, statistics_,
                         NearbyResiduals::irregular_changes(candidate, cj, size));
    known = near.notices(all, NearbyResiduals::Of::rates, noticed) || known;
  }
  std::vector<char> free(n, 0);
  for (std::size_t i = 0; known && i < n; ++i) free[i] = noticed[i] == 0;
  return free;
}

}  // namespace tether::ida_projection
