// Tether: which variables are algebraic, and which of them move with the rest.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "attach/impl.hpp"
#include "rows/column_search.hpp"

namespace tether::ida_projection {

void Projection::Impl::set_id(N_Vector id) {
  if (!id_) id_ = OwnedVector(id);
  if (static_cast<N_Vector>(id_) != id) N_VScale(1.0, id, id_);
  algebraic_.clear();
  if (contiguous_) {
    const double* mask = N_VGetArrayPointer(id_);
    for (int j = 0; j < size_; ++j)
      if (mask[j] == 0.0) algebraic_.push_back(j);
    has_algebraic_ = !algebraic_.empty();
  } else {
    has_algebraic_ = N_VMin(id_) == 0.0;
  }
}

// Component j is algebraic if F does not change at all when y'_j does. F is reached through IDA's
// own residual callback: it evaluates F(t, ypred + ycor, yppred + cj ycor), and ypred can be
// shifted by -ycor (and put back bit for bit) so that only y' feels ycor. Two changes of different
// size are made of many y' at once (ColumnSearch); their sizes vary irregularly with j, so that
// those of one equation do not cancel.
Status Projection::Impl::derive_id(const Candidate& candidate) {
  if (!contiguous_ || options_.derive_id_limit == 0) {
    advise(contiguous_ ? "Options::derive_id_limit is 0" : "vectors without contiguous memory");
    return Status::success;
  }
  constexpr int kSizes = 2;
  const double sizes[kSizes] = {1.0, -1e3};
  const auto n = static_cast<std::size_t>(size_);
  const double cj = step_data().cj;
  OwnedVector ycor(candidate.base), f(candidate.base);
  N_VScale(1.0, candidate.base, saved_);
  N_VConst(0.0, ycor);
  double* e = N_VGetArrayPointer(ycor);
  double* predicted = N_VGetArrayPointer(candidate.base);
  const double* values = N_VGetArrayPointer(f);
  std::vector<double> change[kSizes], y[kSizes], before[kSizes];
  bool known[kSizes] = {};
  const auto residual = [&] {
    ++statistics_.residual_evaluations;
    return this->residual(ycor, f) == 0;
  };
  for (int k = 0; k < kSizes; ++k) {
    for (std::size_t j = 0; j < n; ++j) {
      const double w = candidate.weight_entries[j];
      const double irregular = 1.5 + 0.5 * std::sin(1.0 + (2.3 + k) * static_cast<double>(j));
      // y'_j changes by cj times this.
      change[k].push_back(sizes[k] * irregular *
                          std::max(w > 0.0 ? 1.0 / w : 1.0, 1e-3 / std::abs(cj)));
      // What F sees in all evaluations, bit for bit.
      y[k].push_back((saved_entries_[j] - change[k][j]) + change[k][j]);
    }
    std::copy(y[k].begin(), y[k].end(), predicted);
    known[k] = residual();
    before[k].assign(values, values + size_);
  }
  const auto probe = [&](const std::vector<int>& columns, std::vector<char>& changed) {
    bool answered = false;
    for (int k = 0; k < kSizes; ++k) {
      if (!known[k]) continue;  // F refuses this y'; the other size decides
      std::copy(y[k].begin(), y[k].end(), predicted);
      for (const int i : columns) {
        const auto j = static_cast<std::size_t>(i);
        e[j] = change[k][j];
        predicted[j] = saved_entries_[j] - change[k][j];
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
  const auto outcome =
      ColumnSearch(size_, size_, probe, 2L * options_.derive_id_limit).run(&filled);
  N_VScale(1.0, saved_, candidate.base);
  if (outcome != ColumnSearch::Outcome::found) {
    advise(outcome == ColumnSearch::Outcome::refused
               ? "F could not be evaluated at other y'"
               : "that takes more evaluations of F than 4 times Options::derive_id_limit");
    return Status::success;
  }
  OwnedVector id(candidate.base);
  for (std::size_t j = 0; j < n; ++j) N_VGetArrayPointer(id)[j] = filled[j] ? 1.0 : 0.0;
  set_id(id);
  return Status::success;
}

// Readable through message() as long as nothing else is wrong.
void Projection::Impl::advise(const std::string& reason) {
  advice_ = "algebraic variables were not derived (" + reason +
            ") and stay in the error test; give IDA's id vector in Options::id";
}

// F(t, y, y'_pred), N values, through IDA's own callback: ypred is replaced for the call.
bool Projection::Impl::residual_at(const double* y, double* f) {
  if (!none_) {
    none_ = OwnedVector(present_.base);
    f_ = OwnedVector(present_.base);
    N_VConst(0.0, none_);
  }
  double* base = present_.base_entries;
  std::copy(base, base + size_, saved_entries_);
  std::copy(y, y + size_, base);
  ++statistics_.residual_evaluations;
  const bool evaluated = residual(none_, f_) == 0;
  std::copy(saved_entries_, saved_entries_ + size_, base);
  const double* values = N_VGetArrayPointer(f_);
  std::copy(values, values + size_, f);
  return evaluated;
}

// The equations of F that notice no change of y', bit for bit.
std::vector<char> Projection::Impl::derivative_free_equations(const Candidate& candidate) {
  const auto n = static_cast<std::size_t>(size_);
  const double cj = step_data().cj;
  OwnedVector ycor(candidate.base), none(candidate.base), base(candidate.base),
      shifted(candidate.base);
  N_VScale(1.0, candidate.base, saved_);
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
      const double low = saved_entries_[j] - change;
      candidate.base_entries[j] = low + change;  // what F sees in both evaluations
      e[j] = change;
      lower[j] = low;
    }
    bool ok = residual(none, base) == 0;
    std::copy(lower.begin(), lower.end(), candidate.base_entries);
    ok = residual(ycor, shifted) == 0 && ok;
    statistics_.residual_evaluations += 2;
    N_VScale(1.0, saved_, candidate.base);
    if (!ok) continue;  // F refuses this y'; the other size decides
    known = true;
    const double* before = N_VGetArrayPointer(base);
    const double* after = N_VGetArrayPointer(shifted);
    for (std::size_t i = 0; i < n; ++i) free[i] = free[i] && before[i] == after[i];
  }
  if (!known) free.assign(n, 0);
  return free;
}

// Rows that hang on algebraic variables which equations of F determine are moved together with
// these equations.
void Projection::Impl::join_equations(const Candidate& candidate) {
  if (own_mover_) mover_ = std::move(own_mover_);  // of an attempt that failed
  moved_id_ = OwnedVector();
  if (!contiguous_ || !has_algebraic_ || !has_values(constraints) ||
      size_ > options_.derive_id_limit)
    return;
  const auto n = static_cast<std::size_t>(size_);
  std::vector<double> y(n), WT(n);
  for (std::size_t j = 0; j < n; ++j) {
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
    WT[j] = candidate.weight_entries[j] > 0.0 ? 1.0 / candidate.weight_entries[j] : 0.0;
  }
  Evaluator rows(constraints, statistics_);
  const Residual residual = [this](const double* at, double* f) { return residual_at(at, f); };
  const double* id = N_VGetArrayPointer(id_);
  JoinedEquations found;
  if (contain_algebraic(rows, candidate.t, y, WT, options_.hold, id))
    found = find_joined_equations(rows, residual, derivative_free_equations(candidate), candidate.t,
                                  y, WT, options_.hold, id);
  if (rows.fatal()) stop(-1, rows.message());
  if (found.moves.empty()) return;
  moved_id_ = OwnedVector(candidate.base);
  for (std::size_t j = 0; j < n; ++j)
    N_VGetArrayPointer(moved_id_)[j] = found.moves[j] ? 1.0 : id[j];
  if (found.equations.empty()) return;
  joined_ = constraints + as_constraints(
                              found, residual, [this] { return present_.weight_entries; }, size_);
  std::unique_ptr<Mover> together =
      has_sparse_rows(constraints)
          ? make_sparse_mover(joined_, options_, statistics_, size_, rows.rows())
          : make_dense_mover(joined_, options_, statistics_, size_, rows.rows());
  own_mover_ = std::move(mover_);
  mover_ = std::move(together);
  mover_->reset();
}

// 1 where a variable moves with the rest, 0 where it follows; null: all move.
N_Vector Projection::Impl::moved_id() const {
  if (!has_algebraic_) return nullptr;
  return moved_id_ ? moved_id_ : id_;
}

}  // namespace tether::ida_projection
