// Tether: RowBlocks for sparse rows. SPDX-License-Identifier: BSD-3-Clause
#include "rows/sparse_rows.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::ida_projection {

namespace {

// Sine of the angle at which a row counts as dependent: its square is what A A^T tells from zero.
constexpr double kRankTolerance = 1e-6;

using linalg::at;

}  // namespace

StoredRows::StoredRows(const Evaluator& evaluator, int n) : n_(n) {
  int full = 0;
  for (const Evaluator::Part& part : evaluator.parts()) {
    const SparseJacobian* sparse = part.sparse;
    const int first = static_cast<int>(columns.size());
    for (int i = 0; i < part.set->count; ++i)
      rows.push_back(sparse != nullptr
                         ? Row{first + sparse->starts[at(i)], first + sparse->starts[at(i) + 1], -1}
                         : Row{0, 0, full++});
    if (sparse != nullptr)
      columns.insert(columns.end(), sparse->columns.begin(), sparse->columns.end());
  }
  entries.assign(columns.size(), 0.0);
  full_entries.assign(place(full, 0), 0.0);
}

SparseRows::SparseRows(const Constraints& constraints, const Evaluator& evaluator, int n)
    : constraints_(constraints), m_(evaluator.rows()), n_(n), C_(evaluator, n) {}

// Entries not zero at y or at a point some tolerances away.
Status SparseRows::find_full_columns(Evaluator& evaluator, double t, const std::vector<double>& y0,
                                     const std::vector<double>& WT) {
  C_.full_fills.assign(C_.full_entries.size(), 0);
  C_.entry_fills.assign(C_.entries.size(), 0);
  columns_.resize(at(n_));
  for (int j = 0; j < n_; ++j) columns_[at(j)] = j;
  std::vector<double> y = y0;
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1) y = some_tolerances_away(std::move(y), WT);
    Status status = evaluate(evaluator, t, y.data(), WT.data());
    const bool evaluated = status == Status::success;
    if (evaluated && !(all_finite(C_.entries.data(), C_.entries.size()) &&
                       all_finite(C_.full_entries.data(), C_.full_entries.size())))
      status = Status::not_finite;
    if (status != Status::success && pass == 0) {
      message = evaluated ? "the constraint Jacobian C has an entry that is not finite"
                          : evaluator.message();
      return status;
    }
    if (status != Status::success) continue;
    for (std::size_t e = 0; e < C_.full_fills.size(); ++e)
      C_.full_fills[e] |= C_.full_entries[e] != 0.0;
    for (std::size_t e = 0; e < C_.entry_fills.size(); ++e)
      C_.entry_fills[e] |= C_.entries[e] != 0.0;
  }
  if (evaluator.uses_differences()) look_beyond(evaluator, t, y0.data(), WT.data());
  return Status::success;
}

void SparseRows::look_beyond(Evaluator& evaluator, double t, const double* y, const double* WT) {
  evaluator.sensitive(t, y, n_, WT, [this](int i, int j) { C_.notice(i, j); });
}

Status SparseRows::structure(Evaluator& evaluator, double t, const std::vector<double>& y,
                             const std::vector<double>& WT, const std::vector<bool>& hold,
                             const double* id) {
  structured_ = false;
  outgrown_ = false;
  const Status status = find_full_columns(evaluator, t, y, WT);
  if (status != Status::success) return status;
  kinds_.begin(n_, m_, hold, id);
  for (int i = 0; i < m_; ++i) {
    bool held = false, free = false;
    C_.visit(i, [&](int j, double) {
      if (C_.fills(C_.rows[at(i)], j)) (kinds_.held[at(j)] ? held : free) = true;
    });
    if (free || (!held && C_.rows[at(i)].full >= 0)) continue;
    message = constraints_.name(i) + " depends on no component that is free to move";
    return Status::inconsistent;
  }
  rearrange();
  structured_ = true;
  return Status::success;
}

RowPattern SparseRows::pattern(const std::vector<int>& of_rows) const {
  RowPattern rows;
  rows.n = n_;
  for (const int i : of_rows) {
    const StoredRows::Row& row = C_.rows[at(i)];
    for (int e = row.begin; e < row.end; ++e)
      if (C_.entry_fills[at(e)]) rows.columns.push_back(C_.columns[at(e)]);
    for (int j = 0; row.full >= 0 && j < n_; ++j)
      if (C_.fills(row, j)) rows.columns.push_back(j);
    rows.starts.push_back(static_cast<int>(rows.columns.size()));
  }
  return rows;
}

bool SparseRows::split_by_level(const std::vector<int>& levels, int first) {
  return kinds_.split_by_level(levels, first, [this] {
    rearrange();
    return a.rows.size() == a.columns.size();
  });
}

void SparseRows::join_levels() {
  kinds_.end_by_level();
  rearrange();
}

void SparseRows::rearrange() {
  outgrown_ = false;
  split();
  set_up(d, &gather_d_);
  set_up(a, &gather_a_);
  moved_.assign(a.rows.empty() ? 0 : at(n_), 0.0);
  columns_ = d.columns;
  columns_.insert(columns_.end(), a.columns.begin(), a.columns.end());
  watch();
}

void SparseRows::split() {
  std::vector<char> used(at(n_), 0), algebraic_row(at(m_), 0);
  // An entry of the pattern that is zero wherever it was looked at makes no row algebraic.
  for (int i = 0; i < m_; ++i) {
    int entry = C_.rows[at(i)].begin;
    bool empty = C_.rows[at(i)].full >= 0;
    C_.visit(i, [&](int j, double) {
      const bool is_zero = C_.rows[at(i)].full < 0 && C_.entry_fills[at(entry++)] == 0;
      if (!C_.fills(C_.rows[at(i)], j) || kinds_.held[at(j)]) return;
      empty = false;
      used[at(j)] |= !(kinds_.algebraic(j) && is_zero);
      algebraic_row[at(i)] |= kinds_.algebraic(j) && !is_zero && !kinds_.without[at(i)];
    });
    // A row that vanishes here may come to hang on any of them.
    for (int j = 0; empty && j < n_; ++j)
      used[at(j)] |= !kinds_.held[at(j)] && !kinds_.algebraic(j);
  }
  for (Block* block : {&d, &a}) {
    block->rows.clear();
    block->columns.clear();
  }
  for (const bool full : {false, true})
    for (int i = 0; i < m_; ++i)
      if ((C_.rows[at(i)].full >= 0) == full) (algebraic_row[at(i)] ? a : d).rows.push_back(i);
  for (int j = 0; j < n_; ++j)
    if (used[at(j)]) (kinds_.algebraic(j) ? a : d).columns.push_back(j);
  if (a.rows.size() <= a.columns.size()) return;
  // More rows than algebraic columns to satisfy them with: all rows over all columns together.
  d.rows.insert(d.rows.end(), a.rows.begin(), a.rows.end());
  d.columns.insert(d.columns.end(), a.columns.begin(), a.columns.end());
  std::sort(d.columns.begin(), d.columns.end());
  std::stable_sort(d.rows.begin(), d.rows.end(), [this](int i, int j) {
    return (C_.rows[at(i)].full >= 0) < (C_.rows[at(j)].full >= 0);
  });
  a.rows.clear();
  a.columns.clear();
}

// As in RowBlocks: entries, zero so far, that would bring a new column, or an algebraic one into a
// row that has none.
void SparseRows::watch() {
  watched_entries_.clear();
  watched_full_.clear();
  std::vector<char> used(at(n_), 0), whole(at(m_), 0);
  for (int j : columns_) used[at(j)] = 1;
  const bool split = !a.rows.empty() || std::none_of(d.columns.begin(), d.columns.end(),
                                                     [this](int j) { return kinds_.algebraic(j); });
  for (int i : d.rows) whole[at(i)] = split;
  for (int i = 0; i < m_; ++i) {
    const StoredRows::Row& row = C_.rows[at(i)];
    const auto matters = [&](int j) {
      return !kinds_.held[at(j)] && (!used[at(j)] || (whole[at(i)] != 0 && kinds_.algebraic(j)));
    };
    for (int e = row.begin; e < row.end; ++e)
      if (!C_.entry_fills[at(e)] && matters(C_.columns[at(e)])) watched_entries_.push_back(at(e));
    for (int j = 0; row.full >= 0 && j < n_; ++j)
      if (!C_.fills(row, j) && matters(j)) watched_full_.push_back(C_.place(row.full, j));
  }
  kinds_.mixed.clear();
  for (int i = 0; split && kinds_.any_algebraic() && !kinds_.by_level() && i < m_; ++i) {
    bool mixed = false;
    int entry = C_.rows[at(i)].begin;
    C_.visit(i, [&](int j, double) {
      const bool seen = C_.rows[at(i)].full >= 0 || C_.entry_fills[at(entry++)] != 0;
      mixed = mixed ||
              (seen && C_.fills(C_.rows[at(i)], j) && kinds_.algebraic(j) && !kinds_.held[at(j)]);
    });
    if (mixed) kinds_.mixed.push_back(i);
  }
}

void SparseRows::set_up(Block& block, std::vector<int>* gather) {
  std::vector<int> local(at(n_), -1), starts{0}, columns;
  for (std::size_t k = 0; k < block.columns.size(); ++k)
    local[at(block.columns[k])] = static_cast<int>(k);
  gather->clear();
  int full = 0;
  for (const int i : block.rows) {
    const StoredRows::Row& row = C_.rows[at(i)];
    if (row.full >= 0) {
      ++full;
      continue;
    }
    for (int e = row.begin; e < row.end; ++e)
      if (local[at(C_.columns[at(e)])] >= 0) {
        columns.push_back(local[at(C_.columns[at(e)])]);
        gather->push_back(e);
      }
    starts.push_back(static_cast<int>(columns.size()));
  }
  block.solver.resize(static_cast<int>(block.columns.size()), std::move(starts), std::move(columns),
                      full);
  block.resize();
}

Status SparseRows::evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                            double* g) {
  const Status status =
      evaluator.entries(t, y, n_, WT, columns_, C_.entries.data(), C_.full_entries.data(), g);
  if (status != Status::success || !structured_) return status;
  outgrown_ |= kinds_.changed([&](int i, double* squares) {
    C_.visit(i, [&](int j, double c) {
      if (kinds_.held[at(j)]) return;
      const double entry = c * (WT != nullptr && WT[j] > 0.0 ? WT[j] : 1.0);
      squares[kinds_.algebraic(j) ? 0 : 1] += entry * entry;
    });
  });
  if (!watched_full_.empty() && evaluator.uses_differences() && look_.due())
    look_beyond(evaluator, t, y, WT);
  for (const std::size_t e : watched_entries_) {
    if (C_.entries[e] != 0.0) C_.entry_fills[e] = 1;
    outgrown_ |= C_.entry_fills[e] != 0;
  }
  for (const std::size_t e : watched_full_) {
    if (C_.full_entries[e] != 0.0) C_.full_fills[e] = 1;
    outgrown_ |= C_.full_fills[e] != 0;
  }
  return status;
}

void SparseRows::load(Block& block, const std::vector<int>& gather) {
  double* to = block.solver.entries();
  for (std::size_t k = 0; k < gather.size(); ++k) to[k] = C_.entries[at(gather[k])];
  const int sparse = block.solver.sparse_rows();
  for (int k = sparse; k < block.solver.rows(); ++k) {
    const double* from = C_.full_row(C_.rows[at(block.rows[at(k)])].full);
    double* row = block.solver.full_row(k - sparse);
    block.for_columns([=](int c, int j) { row[c] = from[j]; });
  }
}

bool SparseRows::factor() {
  if (!d.rows.empty()) {
    load(d, gather_d_);
    if (!d.solver.factor(kRankTolerance)) return false;
  }
  if (a.rows.empty()) return true;
  load(a, gather_a_);
  return a.solver.factor(kRankTolerance);
}

void SparseRows::solve(const std::vector<double>& g, double solved) {
  for (std::size_t k = 0; k < d.rows.size(); ++k) d.g[k] = g[at(d.rows[k])];
  d.solver.solve(d.g.data(), d.dy.data(), solved);
  if (a.rows.empty()) return;
  d.for_columns([this](int k, int j) { moved_[at(j)] = d.dy[at(k)]; });
  for (std::size_t k = 0; k < a.rows.size(); ++k)
    a.g[k] = g[at(a.rows[k])] - times(a.rows[k], moved_.data());
  a.solver.solve(a.g.data(), a.dy.data(), solved);
}

double SparseRows::terms(int i, const double* y) const {
  double sum = 0.0;
  C_.visit(i, [&](int j, double c) { sum += std::abs(c * y[j]); });
  return sum;
}

double SparseRows::times(int i, const double* y) const {
  double sum = 0.0;
  C_.visit(i, [&](int j, double c) { sum += c * y[j]; });
  return sum;
}

// |row_i(C WT)| over the block's columns.
double SparseRows::in_tolerances(const Block& block, int i, const std::vector<double>& WT) const {
  double sum = 0.0;
  C_.visit(i, [&](int j, double c) {
    if (std::binary_search(block.columns.begin(), block.columns.end(), j))
      sum += c * WT[at(j)] * (c * WT[at(j)]);
  });
  return std::sqrt(sum);
}

bool SparseRows::contradict(const std::vector<double>& WT) {
  for (const Block* block : {&d, &a}) {
    const auto norm = [&](int i) { return in_tolerances(*block, i, WT); };
    if (contradicts(*block, constraints_, n_, norm, &contradiction)) return true;
  }
  return false;
}

double SparseRows::left_of_dropped(const std::vector<double>& WT) const {
  double largest = 0.0;
  for (const Block* block : {&d, &a})
    largest = std::max(largest, ida_projection::left_of_dropped(*block, n_, [&](int i) {
                         return in_tolerances(*block, i, WT);
                       }));
  return largest;
}

void SparseRows::weigh_dropped(const std::vector<double>& WT) {
  for (Block* block : {&d, &a})
    ida_projection::weigh_dropped(*block, n_, [&](int i) { return in_tolerances(*block, i, WT); });
}

}  // namespace tether::ida_projection
