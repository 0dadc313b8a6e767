// Tether: the rows of C split into those for differential and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
#include "rows/split_rows.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::ida_projection {

using linalg::at;

std::vector<double> some_tolerances_away(std::vector<double> y, const std::vector<double>& WT) {
  for (std::size_t i = 0; i < y.size(); ++i)
    y[i] += (0.7 + 0.6 * std::sin(1.0 + 3.7 * static_cast<double>(i))) *
            std::max(1e-3 * std::abs(y[i]), 10.0 * (WT[i] > 0.0 ? WT[i] : 1e-6));
  return y;
}

// The rank tolerance of sparse rows is the sine of the angle at which a row counts as dependent:
// its square is what A A^T tells from zero.
template <class Solver>
SplitRows<Solver>::SplitRows(const Constraints& constraints, const Evaluator& evaluator, int n)
    : constraints_(constraints),
      m_(evaluator.rows()),
      n_(n),
      rank_tolerance_(!kDense || evaluator.uses_differences() ? 1e-6 : std::max(m_, n) * 1e-13),
      C_(evaluator, n, !kDense) {}

// Entries not zero at y or at a point some tolerances away.
template <class Solver>
Status SplitRows<Solver>::find_seen(Evaluator& evaluator, double t, const std::vector<double>& y0,
                                    const std::vector<double>& WT) {
  C_.forget_seen();
  columns_.resize(at(n_));
  for (int j = 0; j < n_; ++j) columns_[at(j)] = j;
  std::vector<double> y = y0;
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1) y = some_tolerances_away(std::move(y), WT);
    Status status = C_.evaluate(evaluator, t, y.data(), WT.data(), columns_, nullptr);
    const bool evaluated = status == Status::success;
    if (evaluated && !all_finite(C_.values().data(), C_.values().size()))
      status = Status::not_finite;
    if (status != Status::success && pass == 0) {
      message = evaluated ? "the constraint Jacobian C has an entry that is not finite"
                          : evaluator.message();
      return status;
    }
    if (status == Status::success) C_.notice_all();
  }
  if (evaluator.uses_differences()) extend_pattern(evaluator, t, y0.data(), WT.data());
  return Status::success;
}

// Columns that differences do not visit leave no entry in C.
template <class Solver>
void SplitRows<Solver>::extend_pattern(Evaluator& evaluator, double t, const double* y,
                                       const double* WT) {
  evaluator.sensitive(t, y, n_, WT, [this](int i, int j) { C_.notice(i, j); });
}

template <class Solver>
Status SplitRows<Solver>::structure(Evaluator& evaluator, double t, const std::vector<double>& y,
                                    const std::vector<double>& WT, const std::vector<bool>& hold,
                                    const double* id) {
  structured_ = false;
  const Status status = find_seen(evaluator, t, y, WT);
  if (status != Status::success) return status;
  kinds_.begin(n_, m_, hold, id);
  for (int i = 0; i < m_; ++i) {
    bool held = false, free = false;
    C_.visit_places(i, [&](int j, std::size_t, bool seen) {
      if (seen || !C_.full(i)) (kinds_.held[at(j)] ? held : free) = true;
    });
    if (free || (!held && C_.full(i))) continue;
    message = constraints_.name(i) + " depends on no component that is free to move";
    return Status::inconsistent;
  }
  rearrange();
  structured_ = true;
  return Status::success;
}

template <class Solver>
void SplitRows<Solver>::rearrange() {
  outgrown_ = false;
  split();
  set_up(d, &gather_d_);
  set_up(a, &gather_a_);
  moved_.assign(a.rows.empty() ? 0 : at(n_), 0.0);
  watch();
}

template <class Solver>
void SplitRows<Solver>::split() {
  std::vector<char> used(at(n_), 0), algebraic_row(at(m_), 0);
  for (int i = 0; i < m_; ++i) {
    bool empty = C_.full(i);
    C_.visit_places(i, [&](int j, std::size_t, bool seen) {
      if (kinds_.held[at(j)] || (!seen && C_.full(i))) return;
      empty = false;
      // An algebraic entry of the pattern counts only if it differs from zero at one of the points.
      used[at(j)] |= seen || !kinds_.algebraic(j);
      algebraic_row[at(i)] |= seen && kinds_.algebraic(j) && !kinds_.without[at(i)];
    });
    // A row that vanishes at these points may depend on any variable.
    for (int j = 0; empty && j < n_; ++j)
      used[at(j)] |= !kinds_.held[at(j)] && !kinds_.algebraic(j);
  }
  // More rows than algebraic columns to satisfy them with: all rows over all columns together.
  const auto algebraic_rows = std::count(algebraic_row.begin(), algebraic_row.end(), 1);
  std::ptrdiff_t algebraic_columns = 0;
  for (int j = 0; j < n_; ++j) algebraic_columns += used[at(j)] && kinds_.algebraic(j) ? 1 : 0;
  const bool together = algebraic_rows > algebraic_columns;
  for (Block* block : {&d, &a}) {
    block->rows.clear();
    block->columns.clear();
  }
  for (const bool full : {false, true})  // a solver has the sparse ones first
    for (int i = 0; i < m_; ++i)
      if (C_.full(i) == full) (algebraic_row[at(i)] && !together ? a : d).rows.push_back(i);
  columns_.clear();
  for (int j = 0; j < n_; ++j) {
    if (!used[at(j)]) continue;
    (kinds_.algebraic(j) && !together ? a : d).columns.push_back(j);
    columns_.push_back(j);
  }
}

template <class Solver>
void SplitRows<Solver>::set_up(Block& block, std::vector<int>* gather) {
  if constexpr (kDense) {
    block.solver.resize(static_cast<int>(block.rows.size()),
                        static_cast<int>(block.columns.size()));
  } else {
    std::vector<int> local(at(n_), -1), starts{0}, columns;
    for (std::size_t k = 0; k < block.columns.size(); ++k)
      local[at(block.columns[k])] = static_cast<int>(k);
    gather->clear();
    int full = 0;
    for (const int i : block.rows) {
      if (C_.full(i)) {
        ++full;
        continue;
      }
      C_.visit_places(i, [&](int j, std::size_t e, bool) {
        if (local[at(j)] < 0) return;
        columns.push_back(local[at(j)]);
        gather->push_back(static_cast<int>(e));
      });
      starts.push_back(static_cast<int>(columns.size()));
    }
    block.solver.resize(static_cast<int>(block.columns.size()), std::move(starts),
                        std::move(columns), full);
  }
  block.resize();
}

// Entries that are zero so far and would bring a new column, or an algebraic one into a row that
// has none.
template <class Solver>
void SplitRows<Solver>::watch() {
  watched_.clear();
  kinds_.mixed.clear();
  std::vector<char> used(at(n_), 0), whole(at(m_), 0);
  for (int j : columns_) used[at(j)] = 1;
  const bool split = !a.rows.empty() || std::none_of(d.columns.begin(), d.columns.end(),
                                                     [this](int j) { return kinds_.algebraic(j); });
  for (int i : d.rows) whole[at(i)] = split;
  for (int i = 0; i < m_; ++i) {
    bool mixed = false;
    C_.visit_places(i, [&](int j, std::size_t e, bool seen) {
      if (kinds_.held[at(j)]) return;
      mixed = mixed || (seen && kinds_.algebraic(j));
      if (!seen && (!used[at(j)] || (whole[at(i)] != 0 && kinds_.algebraic(j))))
        watched_.push_back(e);
    });
    if (mixed && split) kinds_.mixed.push_back(i);
  }
}

template <class Solver>
Status SplitRows<Solver>::evaluate(Evaluator& evaluator, double t, const double* y,
                                   const double* WT, double* g) {
  const Status status = C_.evaluate(evaluator, t, y, WT, columns_, g);
  if (status != Status::success || !structured_) return status;
  outgrown_ |= kinds_.changed([&](int i, double* squares) {
    C_.visit(i, [&](int j, double c) {
      if (kinds_.held[at(j)]) return;
      const double entry = c * (WT != nullptr && WT[j] > 0.0 ? WT[j] : 1.0);
      squares[kinds_.algebraic(j) ? 0 : 1] += entry * entry;
    });
  });
  if (watched_.empty()) return status;
  if (evaluator.uses_differences() && refresh_.due()) extend_pattern(evaluator, t, y, WT);
  outgrown_ |= C_.notice(watched_);
  return status;
}

template <class Solver>
Status SplitRows<Solver>::learn_trust(Evaluator& evaluator, double t, const double* y,
                                      const double* WT, double length) {
  if constexpr (kDense) {
    if (!trust.wants_to_learn(length)) return Status::success;
    C_after_.resize(C_.values().size());
    const Status status = evaluator.jacobian(t, y, n_, WT, columns_, C_after_.data());
    Block& block = counted();
    if (status == Status::success)
      trust.learn(block.solver, block.rows, block.columns, n_, C_.values(), C_after_, length);
    return status;
  }
  return Status::success;
}

template <class Solver>
bool SplitRows<Solver>::factor(Block& block, const std::vector<int>& gather) {
  if (block.rows.empty()) return true;
  if constexpr (kDense)
    return block.solver.factor(C_.values().data(), n_, block.rows.data(), block.columns.data(),
                               rank_tolerance_);
  else {
    double* to = block.solver.entries();
    for (std::size_t k = 0; k < gather.size(); ++k) to[k] = C_.values()[at(gather[k])];
    const int sparse = block.solver.sparse_rows();
    for (int k = sparse; k < block.solver.rows(); ++k) {
      const double* from = C_.entries(block.rows[at(k)]);
      double* row = block.solver.full_row(k - sparse);
      block.for_columns([=](int c, int j) { row[c] = from[j]; });
    }
    if (!block.solver.factor(rank_tolerance_)) return false;
    block.least_independent = 1.0;
    for (int i = 0; i < block.solver.rows(); ++i)
      block.least_independent = std::min(block.least_independent, block.solver.independent_part(i));
    return true;
  }
}

template <class Solver>
bool SplitRows<Solver>::factor() {
  return factor(d, gather_d_) && factor(a, gather_a_);
}

template <class Solver>
bool SplitRows<Solver>::factor_kept() {
  if constexpr (kDense) {
    for (Block* block : {&d, &a})
      if (!block->rows.empty() &&
          !block->solver.factor_kept(C_.values().data(), n_, block->rows.data(),
                                     block->columns.data()))
        return false;
    return true;
  }
  return false;
}

template <class Solver>
void SplitRows<Solver>::solve_block(Block& block) {
  if constexpr (kDense)
    block.solver.solve(block.g.data(), block.dy.data());
  else
    block.solver.solve(
        block.g.data(), block.dy.data(),
        std::max(kSolved * block.least_independent, linalg::SparseMinimumNorm::kTolerance));
}

template <class Solver>
void SplitRows<Solver>::solve(const std::vector<double>& g) {
  if constexpr (kDense) {
    if (a.rows.empty()) return d.solver.solve(g.data(), d.dy.data());  // d has every row, in order
  }
  for (std::size_t k = 0; k < d.rows.size(); ++k) d.g[k] = g[at(d.rows[k])];
  solve_block(d);
  if (a.rows.empty()) return;
  d.for_columns([this](int k, int j) { moved_[at(j)] = d.dy[at(k)]; });
  for (std::size_t k = 0; k < a.rows.size(); ++k)
    a.g[k] = g[at(a.rows[k])] - times(a.rows[k], moved_.data());
  solve_block(a);
}

template <class Solver>
double SplitRows<Solver>::terms(int i, const double* y) const {
  double sum = 0.0;
  C_.visit(i, [&](int j, double c) { sum += std::abs(c * y[j]); });
  return sum;
}

template <class Solver>
double SplitRows<Solver>::times(int i, const double* y) const {
  double sum = 0.0;
  C_.visit(i, [&](int j, double c) { sum += c * y[j]; });
  return sum;
}

template <class Solver>
LeftOfDropped SplitRows<Solver>::most_left(const Block& block,
                                           const std::vector<double>& WT) const {
  return most_left_of_dropped(block, n_, [&](int i) {  // |row_i(C WT)|
    double sum = 0.0;
    C_.visit(i, [&](int j, double c) {
      if (block.contains(j)) sum += c * WT[at(j)] * (c * WT[at(j)]);
    });
    return std::sqrt(sum);
  });
}

template <class Solver>
double SplitRows<Solver>::left_of_dropped(const std::vector<double>& WT) const {
  return std::max(most_left(d, WT).tolerances, most_left(a, WT).tolerances);
}

template <class Solver>
bool SplitRows<Solver>::contradict(const std::vector<double>& WT) {
  for (const Block* block : {&d, &a}) {
    const LeftOfDropped left = most_left(*block, WT);
    if (!(left.tolerances > kContradiction)) continue;
    contradiction = contradiction_of(*block, left, constraints_);
    return true;
  }
  return false;
}

template class SplitRows<linalg::MinimumNorm>;
template class SplitRows<linalg::SparseMinimumNorm>;

}  // namespace tether::ida_projection
