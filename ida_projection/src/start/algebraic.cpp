// Tether: which variables are algebraic. SPDX-License-Identifier: BSD-3-Clause
#include "start/algebraic.hpp"

#include <algorithm>
#include <cmath>

#include "rows/column_search.hpp"

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

// Does nothing answer to a change of all columns that did not?
bool others_are_silent(const std::vector<char>& filled, const ColumnSearch::Probe& probe) {
  std::vector<int> others;
  for (std::size_t j = 0; j < filled.size(); ++j)
    if (!filled[j]) others.push_back(static_cast<int>(j));
  std::vector<char> changed(filled.size(), 0);
  return others.empty() ||
         (probe(others, changed) && std::count(changed.begin(), changed.end(), 1) == 0);
}

}  // namespace

// Component j is algebraic if F does not change at all when y'_j does. F is reached through IDA's
// own residual callback: it evaluates F(t, ypred + ycor, yppred + cj ycor), and ypred can be
// shifted by -ycor (and put back bit for bit) so that only y' feels ycor. Two changes of different
// size are made of many y' at once (ColumnSearch); their sizes vary irregularly with j, so that
// those of one equation do not cancel. One size looks for the columns, the other one looks at those
// that did not answer, all at once.
std::string AlgebraicVariables::derive(const Candidate& candidate, Corrector& corrector,
                                       double cj) {
  if (candidate.base_entries == nullptr) return "vectors without contiguous memory";
  if (options_.derive_id_limit == 0) return "Options::derive_id_limit is 0";
  constexpr int kSizes = 2;
  const double sizes[kSizes] = {1.0, -1e3};
  const int size = static_cast<int>(N_VGetLength(candidate.base));
  const auto n = static_cast<std::size_t>(size);
  OwnedVector ycor(candidate.base), f(candidate.base), saved(candidate.base);
  N_VScale(1.0, candidate.base, saved);
  const double* saved_entries = N_VGetArrayPointer(saved);
  N_VConst(0.0, ycor);
  double* e = N_VGetArrayPointer(ycor);
  double* predicted = N_VGetArrayPointer(candidate.base);
  const double* values = N_VGetArrayPointer(f);
  std::vector<double> change[kSizes], y[kSizes], before[kSizes];
  bool known[kSizes] = {};
  const auto residual = [&] {
    ++statistics_.residual_evaluations;
    return corrector.residual(ycor, f) == 0;
  };
  for (int k = 0; k < kSizes; ++k) {
    change[k].reserve(n);
    y[k].reserve(n);
    for (std::size_t j = 0; j < n; ++j) {
      const double w = candidate.weight_entries[j];
      const double irregular = 1.5 + 0.5 * std::sin(1.0 + (2.3 + k) * static_cast<double>(j));
      // y'_j changes by cj times this.
      change[k].push_back(sizes[k] * irregular *
                          std::max(w > 0.0 ? 1.0 / w : 1.0, 1e-3 / std::abs(cj)));
      // The arguments of F in all evaluations, bit for bit.
      y[k].push_back((saved_entries[j] - change[k][j]) + change[k][j]);
    }
    std::copy(y[k].begin(), y[k].end(), predicted);
    known[k] = residual();
    before[k].assign(values, values + size);
  }
  bool wanted[kSizes] = {known[0], known[1] && !known[0]};
  const auto probe = [&](const std::vector<int>& columns, std::vector<char>& changed) {
    bool answered = false;
    for (int k = 0; k < kSizes; ++k) {
      if (!wanted[k]) continue;  // F refuses this y', or the other size decides
      std::copy(y[k].begin(), y[k].end(), predicted);
      for (const int i : columns) {
        const auto j = static_cast<std::size_t>(i);
        e[j] = change[k][j];
        predicted[j] = saved_entries[j] - change[k][j];
      }
      const bool evaluated = residual();
      for (const int i : columns) e[i] = 0.0;
      if (!evaluated) continue;
      answered = true;
      for (std::size_t i = 0; i < n; ++i) changed[i] |= !(values[i] == before[k][i]);
    }
    return answered;
  };
  std::vector<char> filled;
  const long most = 4L * options_.derive_id_limit;
  const auto search = [&](long probes) {
    return ColumnSearch(size, size, probe, probes).run(&filled);
  };
  auto outcome = search(most / 2);
  if (known[0] && known[1]) {
    std::swap(wanted[0], wanted[1]);
    if (outcome == ColumnSearch::Outcome::refused ||
        (outcome == ColumnSearch::Outcome::found && !others_are_silent(filled, probe))) {
      wanted[0] = wanted[1] = true;
      outcome = search(most / 4);
    }
  }
  N_VScale(1.0, saved, candidate.base);
  if (outcome == ColumnSearch::Outcome::refused) return "F could not be evaluated at other y'";
  if (outcome != ColumnSearch::Outcome::found)
    return "that takes more evaluations of F than 4 times Options::derive_id_limit";
  OwnedVector id(candidate.base);
  for (std::size_t j = 0; j < n; ++j) N_VGetArrayPointer(id)[j] = filled[j] ? 1.0 : 0.0;
  set(id);
  return {};
}

std::vector<char> AlgebraicVariables::derivative_free_equations(const Candidate& candidate,
                                                                Corrector& corrector,
                                                                double cj) const {
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
  OwnedVector ycor(candidate.base), none(candidate.base), base(candidate.base),
      shifted(candidate.base), saved(candidate.base);
  N_VScale(1.0, candidate.base, saved);
  const double* saved_entries = N_VGetArrayPointer(saved);
  N_VConst(0.0, none);
  double* e = N_VGetArrayPointer(ycor);
  std::vector<double> lower(n);
  std::vector<char> free(n, 1);
  bool known = false;
  for (const double size : {1.0, -0.37}) {
    for (std::size_t j = 0; j < n; ++j) {
      const double w = candidate.weight_entries[j];
      const double change = size * (1.0 + 0.5 * std::sin(1.0 + 2.3 * static_cast<double>(j))) *
                            std::max(w > 0.0 ? 1.0 / w : 1.0, 1e-3 / std::abs(cj));
      const double low = saved_entries[j] - change;
      candidate.base_entries[j] = low + change;  // the argument of F in both evaluations
      e[j] = change;
      lower[j] = low;
    }
    bool ok = corrector.residual(none, base) == 0;
    std::copy(lower.begin(), lower.end(), candidate.base_entries);
    ok = corrector.residual(ycor, shifted) == 0 && ok;
    statistics_.residual_evaluations += 2;
    N_VScale(1.0, saved, candidate.base);
    if (!ok) continue;  // F refuses this y'; the other size decides
    known = true;
    const double* before = N_VGetArrayPointer(base);
    const double* after = N_VGetArrayPointer(shifted);
    for (std::size_t i = 0; i < n; ++i) free[i] = free[i] && before[i] == after[i];
  }
  if (!known) free.assign(n, 0);
  return free;
}

}  // namespace tether::ida_projection
