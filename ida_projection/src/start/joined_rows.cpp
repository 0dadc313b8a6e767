// Tether: rows that are moved together with equations of F. SPDX-License-Identifier: BSD-3-Clause
#include "start/joined_rows.hpp"

#include <algorithm>
#include <vector>

#include "rows/equations.hpp"

namespace tether::ida_projection {

// F(t, y, y'_pred), N values, through IDA's own callback: ypred is replaced for the call.
bool JoinedRows::residual_at(const double* y, double* f) {
  if (!none_) {
    for (OwnedVector* each : {&none_, &f_}) *each = OwnedVector(present_.base);
    N_VConst(0.0, none_);
  }
  ++statistics_.residual_evaluations;
  const bool evaluated = corrector_.residual_with(
                             present_, [y](std::size_t j) { return y[j]; }, none_, f_) == 0;
  std::copy_n(N_VGetArrayPointer(f_), N_VGetLength(f_), f);
  return evaluated;
}

void JoinedRows::forget() {
  rows_.reset();
  moved_id_ = OwnedVector();
  repeats_.clear();
}

void JoinedRows::join(const Candidate& candidate) {
  forget();  // what a failed attempt has left
  begin(candidate);
  if (candidate.base_entries == nullptr || !variables_.any() || !has_values(constraints_)) return;
  const auto size = static_cast<int>(N_VGetLength(candidate.base));
  if (size > kLargestProbed) return;
  const auto n = static_cast<std::size_t>(size);
  std::vector<double> y(n), WT(n);
  for (std::size_t j = 0; j < n; ++j) {
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
    WT[j] = candidate.weight_entries[j] > 0.0 ? 1.0 / candidate.weight_entries[j] : 0.0;
  }
  Evaluator rows(constraints_, statistics_);
  const Residual residual = [this](const double* at, double* f) { return residual_at(at, f); };
  const double* id = variables_.mask();
  const JoinedEquations found = find_joined_equations(
      rows, residual, [&] { return variables_.derivative_free_equations(candidate, corrector_); },
      candidate.t, y, WT, options_.hold, id, variables_.low_index());
  if (rows.report.fatal) corrector_.stop(-1, rows.report.text);
  repeats_ = found.repeats;
  if (found.moves.empty()) return;
  moved_id_ = OwnedVector(candidate.base);
  for (std::size_t j = 0; j < n; ++j)
    N_VGetArrayPointer(moved_id_)[j] = found.moves[j] ? 1.0 : id[j];
  if (found.equations.empty()) return;
  joined_ = constraints_ + as_constraints(
                               found, residual, [this] { return present_.weight_entries; }, size);
  repeats_.resize(static_cast<std::size_t>(rows.rows()), 0);
  repeats_.resize(static_cast<std::size_t>(joined_.total_count()), 1);
  rows_ = make_rows(joined_, options_, statistics_, candidate.base, rows.rows());
  rows_->reset();
}

}  // namespace tether::ida_projection
