// Tether: the rows of C split into those for differential and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
#include "rows/split_rows.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <utility>

#include "host/rounding.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

using linalg::at;

namespace {

// Whether a row is solved for differential variables although it contains algebraic ones. This is
// so if the algebraic part (in tolerances, squared) is negligible beside the rest: solving for it
// would divide by nearly zero. `already`: it was so before.
bool loses_algebraic_part(double algebraic, double differential, bool already) {
  constexpr double kLost = 1e-3, kBack = 1e-2;
  const double share = already ? kBack : kLost;
  return algebraic <= share * share * differential;
}

// The dropped row, k in pivot order, that asks for most beyond the kept ones, in tolerances. Up to
// what a move of the size of a tolerance explains it must follow from them.
struct LeftOfDropped {
  double tolerances = 0.0;
  int k = -1;
};

LeftOfDropped most_left_of_dropped(const Block& block, const StoredRows& C,
                                   const std::vector<double>& WT) {
  return block.solver([&](const auto& solver) {
    LeftOfDropped most;
    for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k) {
      const double norm = solver.row_norm(solver.pivot(k));
      const double inconsistency =
          std::max(0.0, solver.inconsistency(k) - (vanishes(norm) ? 0.0 : 1e2 * kEpsilon));
      if (inconsistency == 0.0) continue;
      double sum = 0.0;  // |row(C WT)|^2
      C.visit(block.rows[at(solver.pivot(k))], [&](int j, double c) {
        if (block.contains(j)) sum += c * WT[at(j)] * (c * WT[at(j)]);
      });
      // A row that vanishes has no distance: so much of its g is tolerated.
      const double weight = vanishes(norm) ? kContradicts * 1e12
                                           : norm / std::max(std::sqrt(sum), 1e-300) /
                                                 std::sqrt(static_cast<double>(WT.size()));
      const double left = inconsistency * weight;
      if (left > most.tolerances) most = {left, k};
    }
    return most;
  });
}

// The rows that this one contradicts, for the caller.
void report_contradiction(const Block& block, const LeftOfDropped& left,
                          const Constraints& constraints, RowsReport& report) {
  block.solver([&](const auto& solver) {
    const int row = block.rows[at(solver.pivot(left.k))];
    if (vanishes(solver.row_norm(solver.pivot(left.k)))) {
      report.rows = {row};
      report.text = constraints.name(row) +
                    ": the gradient vanishes although g = " + brief(solver.inconsistency(left.k));
      return;
    }
    const std::vector<double> share = solver.dependence(left.k);
    std::vector<int> found = {row};
    for (int i = 0; i < solver.rank(); ++i)
      if (std::abs(share[at(i)]) > kInvolved) found.push_back(block.rows[at(solver.pivot(i))]);
    std::sort(found.begin(), found.end());
    report.contradicting(std::move(found), constraints);
    report.text += "; a distance of " + brief(left.tolerances) + " tolerances stays unsolved";
  });
}

}  // namespace

std::vector<double> some_tolerances_away(std::vector<double> y, const std::vector<double>& WT) {
  for (std::size_t i = 0; i < y.size(); ++i)
    y[i] += (0.7 + 0.6 * std::sin(1.0 + 3.7 * static_cast<double>(i))) *
            std::max(1e-3 * std::abs(y[i]), 10.0 * (WT[i] > 0.0 ? WT[i] : 1e-6));
  return y;
}

StoredRows::StoredRows(const Evaluator& evaluator, int n, bool sparse) : n_(n), sparse_(sparse) {
  for (const Evaluator::Part& part : evaluator.parts())
    if (sparse && part.sparse != nullptr)
      columns_.insert(columns_.end(), part.sparse->columns.begin(), part.sparse->columns.end());
  int entry = 0, first_full = static_cast<int>(columns_.size());
  for (const Evaluator::Part& part : evaluator.parts())
    for (int i = 0; i < part.set->count; ++i) {
      const bool full = !sparse || part.sparse == nullptr;
      const int count = full ? n : part.sparse->starts[at(i + 1)] - part.sparse->starts[at(i)];
      int& begin = full ? first_full : entry;
      rows_.push_back({begin, count, full});
      begin += count;
    }
  values_.assign(at(first_full), 0.0);
  seen_.assign(values_.size(), 0);
}

void StoredRows::notice_all() {
  for (std::size_t e = 0; e < seen_.size(); ++e) seen_[e] |= values_[e] != 0.0;
}

bool StoredRows::has_seen(const std::vector<std::size_t>& entries) const {
  return std::any_of(entries.begin(), entries.end(), [this](std::size_t e) { return seen_[e]; });
}

bool StoredRows::notice(const std::vector<std::size_t>& entries) {
  bool found = false;
  for (const std::size_t e : entries) {
    seen_[e] |= values_[e] != 0.0;
    found |= values_[e] != 0.0;
  }
  return found;
}

RowPattern StoredRows::pattern(const std::vector<int>& of_rows) const {
  RowPattern rows;
  rows.n = n_;
  for (const int i : of_rows) {
    visit_places(i, [&rows](int j, std::size_t, bool seen) {
      if (seen) rows.columns.push_back(j);
    });
    rows.starts.push_back(static_cast<int>(rows.columns.size()));
  }
  return rows;
}

double StoredRows::terms(int i, const double* y) const {
  double sum = 0.0;
  visit(i, [&](int j, double c) { sum += std::abs(c * y[j]); });
  return sum;
}

double StoredRows::times(int i, const double* y) const {
  double sum = 0.0;
  visit(i, [&](int j, double c) { sum += c * y[j]; });
  return sum;
}

bool Block::contains(int j) const {
  if (first >= 0) return j >= first && j < first + static_cast<int>(columns.size());
  return std::binary_search(columns.begin(), columns.end(), j);
}

void Block::set_up(const StoredRows& C, int n) {
  const auto count = static_cast<int>(columns.size());
  if (!C.sparse()) {
    dense.resize(static_cast<int>(rows.size()), count);
  } else {
    std::vector<int> local(at(n), -1), starts{0}, entries;
    for (int k = 0; k < count; ++k) local[at(columns[at(k)])] = k;
    gather.clear();
    int full = 0;
    for (const int i : rows) {
      if (C.full(i)) {
        ++full;
        continue;
      }
      C.visit_places(i, [&](int j, std::size_t e, bool) {
        if (local[at(j)] < 0) return;
        entries.push_back(local[at(j)]);
        gather.push_back(static_cast<int>(e));
      });
      starts.push_back(static_cast<int>(entries.size()));
    }
    if (!sparse) sparse = std::make_unique<linalg::SparseMinimumNorm>();
    sparse->resize(count, std::move(starts), std::move(entries), full);
  }
  g.assign(rows.size(), 0.0);
  dy.assign(columns.size(), 0.0);
  const bool adjacent = !columns.empty() && columns.back() - columns.front() + 1 == count;
  first = adjacent ? columns.front() : -1;
}

bool Block::factor(const StoredRows& C, int n, double rank_tolerance) {
  if (!sparse)
    return dense.factor(C.values().data(), n, rows.data(), columns.data(), rank_tolerance);
  double* to = sparse->entries();
  for (std::size_t k = 0; k < gather.size(); ++k) to[k] = C.values()[at(gather[k])];
  for (int k = sparse->sparse_rows(); k < sparse->rows(); ++k)
    for_columns([from = C.entries(rows[at(k)]), row = sparse->full_row(k - sparse->sparse_rows())](
                    int c, int j) { row[c] = from[j]; });
  if (!sparse->factor(rank_tolerance)) return false;
  least_independent = 1.0;
  for (int i = 0; i < sparse->rows(); ++i)
    least_independent = std::min(least_independent, sparse->independent_part(i));
  return true;
}

void Block::solve() {
  if (sparse)
    sparse->solve(g.data(), dy.data(),
                  std::max(linalg::SparseMinimumNorm::kSolved * least_independent,
                           linalg::SparseMinimumNorm::kTolerance));
  else
    dense.solve(g.data(), dy.data());
}

// The rank tolerance of sparse rows is the sine of the angle at which a row counts as dependent:
// its square is what A A^T tells from zero.
SplitRows::SplitRows(const Constraints& constraints, Evaluator& evaluator, int n, bool sparse)
    : constraints_(constraints),
      evaluator_(evaluator),
      m_(evaluator.rows()),
      n_(n),
      rank_tolerance_(sparse || evaluator.uses_differences() ? kQuotientRounding
                                                             : std::max(m_, n) * 1e-13),
      C_(evaluator, n, sparse),
      next_refresh_(kOneIn) {}

// Entries not zero at y or at a point some tolerances away. Columns that differences do not visit
// leave no entry in C.
Status SplitRows::find_seen(double t, const std::vector<double>& y, const std::vector<double>& WT) {
  C_.forget_seen();
  columns_.resize(at(n_));
  std::iota(columns_.begin(), columns_.end(), 0);
  for (const bool away : {false, true}) {
    const std::vector<double> point = away ? some_tolerances_away(y, WT) : y;
    Status status = C_.evaluate(evaluator_, t, point.data(), WT.data(), columns_, nullptr);
    if (status == Status::success && !all_finite(C_.values().data(), C_.values().size())) {
      status = Status::not_finite;
      if (!away)
        evaluator_.report.text = "the constraint Jacobian C has an entry that is not finite";
    }
    if (status == Status::success)
      C_.notice_all();
    else if (!away)
      return status;
  }
  if (evaluator_.uses_differences())
    evaluator_.sensitive(t, y.data(), n_, WT.data(), [this](int i, int j) { C_.notice(i, j); });
  return Status::success;
}

Status SplitRows::structure(double t, const std::vector<double>& y, const std::vector<double>& WT,
                            const std::vector<bool>& hold, const double* id) {
  structured_ = false;
  const Status status = find_seen(t, y, WT);
  if (status != Status::success) return status;
  hold_ = hold;
  id_.assign(id, id != nullptr ? id + n_ : id);
  without_.assign(at(m_), 0);
  for (int i = 0; i < m_; ++i) {
    bool moved = false, stays = false;
    C_.visit_places(i, [&](int j, std::size_t, bool seen) {
      if (seen || !C_.full(i)) (held(j) ? stays : moved) = true;
    });
    if (moved || (!stays && C_.full(i))) continue;
    evaluator_.report.text = constraints_.name(i) + " depends on no component that is free to move";
    return Status::inconsistent;
  }
  rearrange();
  structured_ = true;
  return Status::success;
}

void SplitRows::rearrange() {
  outgrown_ = false;
  split();
  d.set_up(C_, n_);
  a.set_up(C_, n_);
  moved_.assign(a.rows.empty() ? 0 : at(n_), 0.0);
  watch();
}

void SplitRows::split() {
  std::vector<char> used(at(n_), 0), algebraic_row(at(m_), 0);
  for (int i = 0; i < m_; ++i) {
    bool empty = C_.full(i);
    C_.visit_places(i, [&](int j, std::size_t, bool seen) {
      if (held(j) || (!seen && C_.full(i))) return;
      empty = false;
      // An algebraic entry of the pattern counts only if it differs from zero at one of the points.
      used[at(j)] |= seen || !algebraic(j);
      algebraic_row[at(i)] |= seen && algebraic(j) && !without_[at(i)];
    });
    // A row that vanishes at these points may depend on any variable.
    for (int j = 0; empty && j < n_; ++j) used[at(j)] |= !held(j) && !algebraic(j);
  }
  // More rows than algebraic columns to satisfy them with: all rows over all columns together.
  const auto algebraic_rows = std::count(algebraic_row.begin(), algebraic_row.end(), 1);
  std::ptrdiff_t algebraic_columns = 0;
  for (int j = 0; j < n_; ++j) algebraic_columns += used[at(j)] && algebraic(j) ? 1 : 0;
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
    (algebraic(j) && !together ? a : d).columns.push_back(j);
    columns_.push_back(j);
  }
}

// Finds entries that are zero so far and would bring a new column, or an algebraic one into a row
// that has none.
void SplitRows::watch() {
  watched_.clear();
  mixed_.clear();
  std::vector<char> used(at(n_), 0), whole(at(m_), 0);
  for (int j : columns_) used[at(j)] = 1;
  const bool split = !a.rows.empty() || std::none_of(d.columns.begin(), d.columns.end(),
                                                     [this](int j) { return algebraic(j); });
  for (int i : d.rows) whole[at(i)] = split;
  for (int i = 0; i < m_; ++i) {
    bool mixed = false;
    C_.visit_places(i, [&](int j, std::size_t e, bool seen) {
      if (held(j)) return;
      mixed = mixed || (seen && algebraic(j));
      if (!seen && (!used[at(j)] || (whole[at(i)] != 0 && algebraic(j)))) watched_.push_back(e);
    });
    if (mixed && split) mixed_.push_back(i);
  }
}

// Whether entries of C that was evaluated at y ask for other blocks.
void SplitRows::inspect(double t, const double* y, const double* WT) {
  for (const int i : mixed_) {
    double squares[2] = {0.0, 0.0};  // of the differential and the algebraic part, in tolerances
    C_.visit(i, [&](int j, double c) {
      const double entry = held(j) ? 0.0 : c * (WT != nullptr && WT[j] > 0.0 ? WT[j] : 1.0);
      squares[algebraic(j) ? 1 : 0] += entry * entry;
    });
    char& without = without_[at(i)];
    const bool lost = (of_F_.empty() || of_F_[at(i)] == 0) &&
                      loses_algebraic_part(squares[1], squares[0], without != 0);
    outgrown_ |= lost != (without != 0);
    without = lost ? 1 : 0;
  }
  if (watched_.empty()) return;
  if (evaluator_.uses_differences() && ++evaluations_ >= next_refresh_) {
    next_refresh_ = std::max<long>(kOneIn, 2 * evaluations_);
    evaluator_.sensitive(t, y, n_, WT, [this](int i, int j) { C_.notice(i, j); });
    outgrown_ |= C_.has_seen(watched_);
  }
  outgrown_ |= C_.notice(watched_);
}

Status SplitRows::learn_trust(double t, const double* y, const double* WT, double length) {
  if (C_.sparse() || !trust.wants_to_learn(length)) return Status::success;
  C_after_.resize(C_.values().size());
  const Status status = evaluator_.jacobian(t, y, n_, WT, columns_, C_after_.data());
  Block& block = counted();
  if (status == Status::success)
    trust.learn(block.dense, block.rows, block.columns, n_, C_.values(), C_after_, length);
  return status;
}

bool SplitRows::factor() {
  return (d.rows.empty() || d.factor(C_, n_, rank_tolerance_)) &&
         (a.rows.empty() || a.factor(C_, n_, rank_tolerance_));
}

void SplitRows::solve_blocks(const std::vector<double>& g) {
  for (std::size_t k = 0; k < d.rows.size(); ++k) d.g[k] = g[at(d.rows[k])];
  const bool moves = !d.rows.empty();
  if (moves) d.solve();
  if (a.rows.empty()) return;
  if (moves) d.for_columns([this](int k, int j) { moved_[at(j)] = d.dy[at(k)]; });
  for (std::size_t k = 0; k < a.rows.size(); ++k) {
    a.g[k] = g[at(a.rows[k])];
    if (!moves) continue;
    double change = 0.0;  // without held columns, where C need not be finite
    C_.visit(a.rows[k], [&](int j, double c) {
      if (moved_[at(j)] != 0.0) change += c * moved_[at(j)];
    });
    a.g[k] -= change;
  }
  a.solve();
}

bool SplitRows::drops_rows() const {
  const auto drops = [](const auto& solver) { return solver.dropped() > 0; };
  return d.solver(drops) || a.solver(drops);
}

double SplitRows::left_of_dropped(const std::vector<double>& WT) const {
  return std::max(most_left_of_dropped(d, C_, WT).tolerances,
                  most_left_of_dropped(a, C_, WT).tolerances);
}

bool SplitRows::contradict(const std::vector<double>& WT) {
  for (const Block* block : {&d, &a}) {
    const LeftOfDropped left = most_left_of_dropped(*block, C_, WT);
    if (!(left.tolerances > kContradicts)) continue;
    report_contradiction(*block, left, constraints_, evaluator_.report);
    return true;
  }
  return false;
}

}  // namespace tether::ida_projection
