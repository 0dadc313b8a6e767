// Tether: which variables are algebraic, and of which index. SPDX-License-Identifier: BSD-3-Clause
#include "start/algebraic.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "host/rounding.hpp"
#include "host/shortest.hpp"
#include "rows/column_search.hpp"
#include "start/linear_system.hpp"
#include "start/nearby_residuals.hpp"

namespace tether::ida_projection {

namespace {

using Near = NearbyResiduals;

}  // namespace

void AlgebraicVariables::set(N_Vector id) {
  if (!id_) id_ = OwnedVector(id);
  if (static_cast<N_Vector>(id_) != id) N_VScale(1.0, id, id_);
  if (is_contiguous(id_)) {
    const double* mask = N_VGetArrayPointer(id_);
    algebraic_ = static_cast<sunindextype>(std::count(mask, mask + N_VGetLength(id_), 0.0));
  } else {
    algebraic_ = N_VMin(id_) == 0.0 ? 1 : 0;
  }
}

std::vector<int> AlgebraicVariables::algebraic() const {
  std::vector<int> found;
  for (int j = 0; any() && j < static_cast<int>(N_VGetLength(id_)); ++j)
    if (!differential(j)) found.push_back(j);
  return found;
}

// Component j is algebraic if no bit of F changes with y'_j. ColumnSearch changes many y' at once
// and finds the columns that change F. A change of another size, of all other columns at once,
// confirms that these do not.
std::string AlgebraicVariables::derive(const Candidate& candidate, Corrector& corrector) {
  if (known()) return {};
  const auto failed = [](const std::string& why) {
    return "algebraic variables were not derived (" + why +
           ") and stay in the error test; give IDA's id vector in Options::id";
  };
  if (candidate.base_entries == nullptr) return failed("vectors without contiguous memory");
  const int size = static_cast<int>(N_VGetLength(candidate.base));
  Near small(candidate, corrector, statistics_, Near::irregular_changes(candidate, 1.0));
  Near large(candidate, corrector, statistics_, Near::irregular_changes(candidate, -1e3, 3.3));
  std::vector<Near*> by;  // F may fail at one size; the other one decides then
  if (small.known() || large.known()) by = {small.known() ? &small : &large};
  const auto probe = [&](const std::vector<int>& columns, std::vector<char>& changed) {
    bool evaluated = false;
    for (Near* near : by) evaluated = near->notices(columns, Near::Of::rates, changed) || evaluated;
    return evaluated;
  };
  std::vector<char> filled;
  constexpr long most = 4L * kLargestProbed;
  const auto search = [&](long probes) {
    return ColumnSearch(size, size, probe, probes).run(&filled);
  };
  const auto others_are_silent = [&] {
    std::vector<int> others;
    for (int j = 0; j < size; ++j)
      if (!filled[static_cast<std::size_t>(j)]) others.push_back(j);
    std::vector<char> changed(filled.size(), 0);
    return others.empty() ||
           (probe(others, changed) && std::count(changed.begin(), changed.end(), 1) == 0);
  };
  auto outcome = search(most / 2);
  if (small.known() && large.known()) {
    by = {&large};
    if (outcome == ColumnSearch::Outcome::refused ||
        (outcome == ColumnSearch::Outcome::found && !others_are_silent())) {
      by = {&small, &large};
      outcome = search(most / 4);
    }
  }
  if (outcome == ColumnSearch::Outcome::refused)
    return failed("F could not be evaluated at other y'");
  if (outcome != ColumnSearch::Outcome::found)
    return failed("that takes more than " + std::to_string(most) + " evaluations of F");
  OwnedVector id(candidate.base);
  std::copy(filled.begin(), filled.end(), N_VGetArrayPointer(id));
  set(id);
  return {};
}

// Sets noticed[i] for equations that notice the components at one of these sizes; F may fail at
// others. False: it fails at all of them.
bool AlgebraicVariables::noticed_by(const std::vector<int>& components, bool rates,
                                    std::initializer_list<double> sizes, const Candidate& candidate,
                                    Corrector& corrector, std::vector<char>& noticed) const {
  bool known = false;
  for (const double size : sizes) {
    Near near(candidate, corrector, statistics_, Near::irregular_changes(candidate, size));
    known = near.notices(components, rates ? Near::Of::rates : Near::Of::values, noticed) || known;
  }
  return known;
}

std::vector<char> AlgebraicVariables::derivative_free_equations(const Candidate& candidate,
                                                                Corrector& corrector) const {
  std::vector<char> noticed(static_cast<std::size_t>(N_VGetLength(candidate.base)), 0);
  std::vector<int> all(noticed.size());
  std::iota(all.begin(), all.end(), 0);
  if (!noticed_by(all, true, {1.0, -0.37}, candidate, corrector, noticed))
    return std::vector<char>(noticed.size(), 0);
  for (char& equation : noticed) equation = equation == 0;
  return noticed;
}

// Those called algebraic whose y' F notices; all of them are changed at once first.
std::vector<int> AlgebraicVariables::with_derivative(const Candidate& candidate,
                                                     Corrector& corrector) const {
  const std::vector<int> given = algebraic();
  std::vector<char> noticed(static_cast<std::size_t>(N_VGetLength(candidate.base)), 0);
  if (given.empty() || !noticed_by(given, true, {1.0, -0.37}, candidate, corrector, noticed) ||
      std::count(noticed.begin(), noticed.end(), 1) == 0)
    return {};
  AlgebraicVariables derived(statistics_);
  std::vector<int> moving;
  if (derived.derive(candidate, corrector).empty())
    std::copy_if(given.begin(), given.end(), std::back_inserter(moving),
                 [&](int j) { return derived.differential(j); });
  return moving;
}

const std::string& AlgebraicVariables::doubts(const Candidate& candidate, Corrector& corrector) {
  if (doubts_) return *doubts_;
  std::string& text = doubts_.emplace();
  if (candidate.base_entries == nullptr) return text;
  const std::vector<int> moving = with_derivative(candidate, corrector);
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

// The matrix of exceeds_one() is singular if it has rows of zeros: equations of F that contain
// neither y' nor y_a, as constraints of positions and velocities do. If there are as many of them
// as algebraic variables, it determines none of these. Costs eight evaluations of F at any size.
bool AlgebraicVariables::has_rows_of_zeros(const Candidate& candidate, Corrector& corrector) {
  if (!any() || all()) return false;
  const std::vector<char> free = derivative_free_equations(candidate, corrector);
  const std::vector<int> unknowns = algebraic();
  std::vector<char> noticed(free.size(), 0);
  const bool evaluated = noticed_by(unknowns, false, {1.0, -1e3}, candidate, corrector, noticed);
  std::size_t zeros = 0;
  for (std::size_t i = 0; i < free.size(); ++i) zeros += free[i] != 0 && noticed[i] == 0;
  if (!evaluated || zeros == 0) return false;
  if (zeros == unknowns.size()) found_.undetermined = unknowns;
  return true;
}

// The differential variables do not depend on an output, so that their error test says nothing
// about it: no equation with y' contains it, nor an equation that shares an unknown with what such
// an equation contains. `slopes`: F_y'_j of differential and F_y_j of algebraic columns.
void AlgebraicVariables::find_outputs(const Eigen::MatrixXd& slopes) {
  const int n = static_cast<int>(slopes.cols());
  std::vector<char> acts(static_cast<std::size_t>(n), 0), known(acts);  // columns, rows
  const auto acts_in = [&](int i, int j) {
    return slopes(i, j) != 0.0 && (differential(j) || acts[static_cast<std::size_t>(j)] != 0);
  };
  for (bool more = true; more;) {
    more = false;
    for (int i = 0; i < n; ++i) {
      char& row = known[static_cast<std::size_t>(i)];
      if (row != 0) continue;
      for (int j = 0; row == 0 && j < n; ++j) row = acts_in(i, j);
      if (row == 0) continue;
      more = true;
      for (int j = 0; j < n; ++j)
        if (!differential(j) && slopes(i, j) != 0.0) acts[static_cast<std::size_t>(j)] = 1;
    }
  }
  for (const int j : algebraic())
    if (acts[static_cast<std::size_t>(j)] == 0) found_.outputs.push_back(j);
}

// `slopes` as exceeds_one() has found them; the index needs F_y of the differential columns as
// well.
int AlgebraicVariables::index_above_one(const Candidate& candidate, Corrector& corrector,
                                        Eigen::MatrixXd slopes) {
  const int n = static_cast<int>(slopes.rows());
  std::vector<double> unit(static_cast<std::size_t>(n)), change(unit);
  for (std::size_t j = 0; j < unit.size(); ++j) {
    unit[j] = std::max(1.0, std::abs(candidate.base_entries[j]));
    change[j] = kIncrement * unit[j];
  }
  Near near(candidate, corrector, statistics_, std::move(change));
  Eigen::MatrixXd E = Eigen::MatrixXd::Zero(n, n);
  for (int j = 0; j < n; ++j) {
    if (differential(j)) {
      E.col(j) = slopes.col(j) / candidate.cj;
      if (!near.slope(j, Near::Of::values, slopes.col(j))) return 0;
    }
    E.col(j) *= unit[static_cast<std::size_t>(j)];
    slopes.col(j) *= unit[static_cast<std::size_t>(j)];
  }
  return differential_index(std::move(E), std::move(slopes));
}

// F determines y'_d and y_a, its index is 1 at most, where the matrix of F_y'_j (j differential)
// and F_y_j (j algebraic) is regular. It is singular for multipliers of position or velocity rows
// (index 2 and 3), and where combinations of differential variables are algebraic. Algebraic
// variables that the matrix leaves free carry rounding divided by the step: they are undetermined.
AlgebraicVariables::Index AlgebraicVariables::exceeds_one(const Candidate& candidate,
                                                          Corrector& corrector, long usual) {
  if (candidate.base_entries == nullptr) return Index::presumed_low;
  const int size = static_cast<int>(N_VGetLength(candidate.base));
  if (size > (usual >= size ? kLargestProbed : kLargestSize))
    return has_rows_of_zeros(candidate, corrector) ? Index::high : Index::presumed_low;
  std::vector<double> change(static_cast<std::size_t>(size));
  for (int j = 0; j < size; ++j) {
    const double w = candidate.weight_entries[j];
    change[static_cast<std::size_t>(j)] =
        std::max(w > 0.0 ? 1.0 / w : 1.0, differential(j)
                                              ? 1e-3 / std::abs(candidate.cj)
                                              : kIncrement * std::abs(candidate.base_entries[j]));
  }
  Near near(candidate, corrector, statistics_, std::move(change));
  Eigen::MatrixXd slopes(size, size);
  for (int j = 0; j < size; ++j) {
    if (!near.slope(j, differential(j) ? Near::Of::rates : Near::Of::values, slopes.col(j))) {
      return Index::unknown;  // the next run tries again
    }
    if (differential(j) && slopes.col(j).isZero(0.0)) found_.without_derivative.push_back(j);
  }
  if (any()) find_outputs(slopes);
  const std::vector<char> left = undetermined_columns(slopes, true);
  if (left.empty()) return Index::low;
  if (any() && size <= kLargestSize)
    found_.index = index_above_one(candidate, corrector, std::move(slopes));
  for (const int j : algebraic())
    if (left[static_cast<std::size_t>(j)]) found_.undetermined.push_back(j);
  return Index::high;
}

void AlgebraicVariables::find_index(const Candidate& candidate, Corrector& corrector, long usual) {
  if (found_.is == Index::unknown) {
    found_ = Found();
    found_.is = exceeds_one(candidate, corrector, usual);
  }
  index_ = found_.is == Index::unknown ? Index::presumed_low : found_.is;
}

// Coupled ones are not tested where F is of higher index and does not tell which it leaves free.
bool AlgebraicVariables::choose_tested(bool coupled) {
  coupled_.clear();
  if (!any() || found_.is == Index::unknown || !is_contiguous(id_)) return false;
  tested_ = copy_of(id_);
  double* tested = N_VGetArrayPointer(tested_);
  for (const int j : found_.outputs) tested[j] = 1.0;
  const std::vector<int>& free = found_.undetermined;
  if (!coupled || (found_.is == Index::high && free.empty())) return true;
  for (const int j : algebraic())
    if (tested[j] == 0.0 && !std::binary_search(free.begin(), free.end(), j)) coupled_.push_back(j);
  for (const int j : coupled_) tested[j] = 1.0;
  return true;
}

}  // namespace tether::ida_projection
