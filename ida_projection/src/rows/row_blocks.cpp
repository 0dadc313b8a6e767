// Tether: the rows of C split into those for differential and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
#include "rows/row_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

namespace tether::ida_projection {

namespace {

constexpr double kFewPlaces = 4.0;  // times as many entries as places are worth their lists

// Looks at all entries of C without a branch for each, as next to always none is.
bool any_not_zero(const double* C, const std::vector<std::size_t>& entries) {
  std::uint64_t bits = 0;
  for (const std::size_t e : entries) {
    std::uint64_t entry;
    std::memcpy(&entry, C + e, sizeof entry);
    bits |= entry << 1;  // but for the sign
  }
  return bits != 0;
}

}  // namespace

std::vector<double> some_tolerances_away(std::vector<double> y, const std::vector<double>& WT) {
  for (std::size_t i = 0; i < y.size(); ++i)
    y[i] += (0.7 + 0.6 * std::sin(1.0 + 3.7 * static_cast<double>(i))) *
            std::max(1e-3 * std::abs(y[i]), 10.0 * (WT[i] > 0.0 ? WT[i] : 1e-6));
  return y;
}

RowBlocks::RowBlocks(const Constraints& constraints, const Evaluator& evaluator, int n)
    : constraints_(constraints),
      m_(evaluator.rows()),
      n_(n),
      rank_tolerance_(evaluator.uses_differences() ? 1e-6 : std::max(m_, n) * 1e-13),
      C_(static_cast<std::size_t>(m_) * static_cast<std::size_t>(n), 0.0),
      by_places_(m_ > linalg::MinimumNorm::kSmallRows) {
  if (by_places_) places_.resize(m_, n);
}

// Many rows are mostly zero: only what was ever filled is made zero again. What a callback that
// failed has left is not known.
Status RowBlocks::fill(Evaluator& evaluator, double t, const double* y, const double* WT,
                       double* g) {
  if (!by_places_) {
    std::fill(C_.begin(), C_.end(), 0.0);
    return evaluator.jacobian_into_zeros(t, y, n_, WT, columns_, C_.data(), g);
  }
  if (zero_elsewhere_)
    places_.clear_all(C_.data());
  else
    std::fill(C_.begin(), C_.end(), 0.0);
  zero_elsewhere_ = false;
  const Status status = evaluator.jacobian_into_zeros(t, y, n_, WT, columns_, C_.data(), g);
  if (status != Status::success) return status;
  places_.look_at_all(C_.data());
  zero_elsewhere_ = by_places_ =
      kFewPlaces * static_cast<double>(places_.known()) <= static_cast<double>(C_.size());
  return status;
}

Status RowBlocks::structure(Evaluator& evaluator, double t, const std::vector<double>& y0,
                            const std::vector<double>& WT, const std::vector<bool>& hold,
                            const double* id) {
  structured_ = zero_elsewhere_ = false;
  const auto n = static_cast<std::size_t>(n_);
  filled_.assign(static_cast<std::size_t>(m_) * n, 0);
  std::vector<double> y = y0;
  std::vector<int> all(n);
  for (std::size_t j = 0; j < n; ++j) all[j] = static_cast<int>(j);
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1) y = some_tolerances_away(std::move(y), WT);
    Status status = evaluator.jacobian(t, y.data(), n_, WT.data(), all, C_.data());
    const bool evaluated = status == Status::success;
    if (evaluated && !all_finite(C_.data(), C_.size())) status = Status::not_finite;
    if (status != Status::success && pass == 0) {
      message = evaluated ? "the constraint Jacobian C has an entry that is not finite"
                          : evaluator.message();
      return status;
    }
    if (status == Status::success)
      for (std::size_t e = 0; e < filled_.size(); ++e) filled_[e] |= C_[e] != 0.0;
  }
  evaluator.sensitive(t, y0.data(), n_, WT.data(), [this](int i, int j) { notice(i, j); });

  kinds_.begin(n_, m_, hold, id);
  for (int i = 0; i < m_; ++i) {
    bool held = false, free = false;
    for (int j = 0; j < n_; ++j)
      if (fills(i, j)) (kinds_.held[static_cast<std::size_t>(j)] ? held : free) = true;
    if (!held || free) continue;
    message = constraints_.name(i) + " depends on no component that is free to move";
    return Status::inconsistent;
  }
  rearrange();
  structured_ = true;
  return Status::success;
}

RowPattern RowBlocks::pattern(const std::vector<int>& of_rows) const {
  RowPattern rows;
  rows.n = n_;
  for (const int i : of_rows) {
    for (int j = 0; j < n_; ++j)
      if (fills(i, j)) rows.columns.push_back(j);
    rows.starts.push_back(static_cast<int>(rows.columns.size()));
  }
  return rows;
}

bool RowBlocks::split_by_level(const std::vector<int>& levels, int first) {
  return kinds_.split_by_level(levels, first, [this] {
    rearrange();
    return a.rows.size() == a.columns.size();
  });
}

void RowBlocks::join_levels() {
  kinds_.end_by_level();
  rearrange();
}

void RowBlocks::rearrange() {
  const auto n = static_cast<std::size_t>(n_);
  outgrown_ = false;
  std::vector<char> row_is_algebraic(static_cast<std::size_t>(m_), 0), used(n, 0);
  for (int i = 0; i < m_; ++i) {
    bool empty = true;
    for (int j = 0; j < n_; ++j) {
      if (!fills(i, j) || kinds_.held[static_cast<std::size_t>(j)]) continue;
      empty = false;
      used[static_cast<std::size_t>(j)] = 1;
      if (kinds_.algebraic(j) && !kinds_.without[static_cast<std::size_t>(i)])
        row_is_algebraic[static_cast<std::size_t>(i)] = 1;
    }
    // A row that vanishes here may come to hang on any of them.
    for (int j = 0; empty && j < n_; ++j)
      if (!kinds_.held[static_cast<std::size_t>(j)] && !kinds_.algebraic(j))
        used[static_cast<std::size_t>(j)] = 1;
  }
  for (Block* block : {&d, &a}) {
    block->rows.clear();
    block->columns.clear();
  }
  for (int i = 0; i < m_; ++i)
    (row_is_algebraic[static_cast<std::size_t>(i)] ? a : d).rows.push_back(i);
  for (int j = 0; j < n_; ++j)
    if (used[static_cast<std::size_t>(j)]) (kinds_.algebraic(j) ? a : d).columns.push_back(j);
  // More rows than algebraic columns to satisfy them with: all rows over all columns together.
  if (a.rows.size() > a.columns.size()) {
    for (int i : a.rows) d.rows.push_back(i);
    for (int j : a.columns) d.columns.push_back(j);
    std::sort(d.rows.begin(), d.rows.end());
    std::sort(d.columns.begin(), d.columns.end());
    a.rows.clear();
    a.columns.clear();
  }
  for (Block* block : {&d, &a}) {
    block->solver.resize(static_cast<int>(block->rows.size()),
                         static_cast<int>(block->columns.size()));
    block->resize();
  }
  few_ = !many(m_) && static_cast<int>(d.columns.size()) <= linalg::MinimumNorm::kSmallColumns &&
         a.rows.empty() && d.first >= 0 && static_cast<int>(d.rows.size()) == m_;
  columns_.clear();
  for (int j = 0; j < n_; ++j)
    if (used[static_cast<std::size_t>(j)]) columns_.push_back(j);
  watch();
}

// Entries that are zero so far and would bring a new column, or an algebraic one into a row that
// has none.
void RowBlocks::watch() {
  watched_.clear();
  std::vector<char> used(static_cast<std::size_t>(n_), 0);
  for (int j : columns_) used[static_cast<std::size_t>(j)] = 1;
  const auto row_watches = [this](int i, const auto& wanted) {
    for (int j = 0; j < n_; ++j)
      if (!kinds_.held[static_cast<std::size_t>(j)] && !fills(i, j) && wanted(j))
        watched_.push_back(static_cast<std::size_t>(i) * static_cast<std::size_t>(n_) +
                           static_cast<std::size_t>(j));
  };
  const bool split = !a.rows.empty() || std::none_of(d.columns.begin(), d.columns.end(),
                                                     [this](int j) { return kinds_.algebraic(j); });
  for (int i : d.rows)
    row_watches(i, [&](int j) {
      return !used[static_cast<std::size_t>(j)] || (split && kinds_.algebraic(j));
    });
  for (int i : a.rows) row_watches(i, [&](int j) { return !used[static_cast<std::size_t>(j)]; });
  kinds_.mixed.clear();
  for (int i = 0; split && !kinds_.by_level() && i < m_; ++i)
    for (int j : columns_)
      if (fills(i, j) && kinds_.algebraic(j)) {
        kinds_.mixed.push_back(i);
        break;
      }
}

Status RowBlocks::evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                           double* g) {
  const Status status = fill(evaluator, t, y, WT, g);
  if (status != Status::success || !structured_) return status;
  outgrown_ |= kinds_.changed([&](int i, double* squares) {
    for (int j : columns_) {
      const double entry = row(i)[j] * (WT != nullptr && WT[j] > 0.0 ? WT[j] : 1.0);
      squares[kinds_.algebraic(j) ? 0 : 1] += entry * entry;
    }
  });
  if (watched_.empty()) return status;
  const bool look = evaluator.uses_differences() && look_.due();
  if (look) look_beyond(evaluator, t, y, WT);
  if (!look && !any_not_zero(C_.data(), watched_)) return status;
  for (const std::size_t e : watched_) {
    if (C_[e] != 0.0) filled_[e] = 1;
    outgrown_ |= filled_[e] != 0;
  }
  return status;
}

// Columns that differences do not visit leave no entry in C.
void RowBlocks::look_beyond(Evaluator& evaluator, double t, const double* y, const double* WT) {
  evaluator.sensitive(t, y, n_, WT, [this](int i, int j) { notice(i, j); });
}

Status RowBlocks::learn_trust(Evaluator& evaluator, double t, const double* y, const double* WT,
                              double length) {
  if (!trust.wants_to_learn(length)) return Status::success;
  C_after_.resize(C_.size());
  const Status status = evaluator.jacobian(t, y, n_, WT, columns_, C_after_.data());
  Block& block = counted();
  if (status == Status::success)
    trust.learn(block.solver, block.rows, block.columns, n_, C_, C_after_, length);
  return status;
}

bool RowBlocks::factor() {
  for (Block* block : {&d, &a})
    if (!block->rows.empty() &&
        !block->solver.factor(C_.data(), n_, block->rows.data(), block->columns.data(),
                              rank_tolerance_, zero_elsewhere_ ? &places_ : nullptr))
      return false;
  return true;
}

void RowBlocks::solve_both(const std::vector<double>& g) {
  for (std::size_t i = 0; i < d.rows.size(); ++i) d.g[i] = g[static_cast<std::size_t>(d.rows[i])];
  d.solve();
  for (std::size_t i = 0; i < a.rows.size(); ++i) {
    const double* c = row(a.rows[i]);
    double rest = g[static_cast<std::size_t>(a.rows[i])];
    for (std::size_t k = 0; k < d.columns.size(); ++k) rest -= c[d.columns[k]] * d.dy[k];
    a.g[i] = rest;
  }
  a.solve();
}

double RowBlocks::terms(int i, const double* y) const {
  double sum = 0.0;
  visit_row(i, [&](int j, double c) { sum += std::abs(c * y[j]); });
  return sum;
}

double RowBlocks::times(int i, const double* y) const {
  double sum = 0.0;
  visit_row(i, [&](int j, double c) { sum += c * y[j]; });
  return sum;
}

// |row_i(C WT)| over the block's columns.
double RowBlocks::in_tolerances(const Block& block, int i, const std::vector<double>& WT) const {
  double sum = 0.0;
  const auto add = [&](int j, double entry) {
    const double c = entry * WT[static_cast<std::size_t>(j)];
    sum += c * c;
  };
  const int last = block.first + static_cast<int>(block.columns.size());
  if (block.first >= 0)
    visit_row(i, [&](int j, double entry) {
      if (j >= block.first && j < last) add(j, entry);
    });
  else
    for (int j : block.columns) add(j, row(i)[j]);
  return std::sqrt(sum);
}

bool RowBlocks::contradict(const std::vector<double>& WT) {
  for (const Block* block : {&d, &a}) {
    const auto norm = [&](int i) { return in_tolerances(*block, i, WT); };
    if (contradicts(*block, constraints_, n_, norm, &contradiction)) return true;
  }
  return false;
}

double RowBlocks::left_of_dropped(const std::vector<double>& WT) const {
  double largest = 0.0;
  for (const Block* block : {&d, &a})
    largest = std::max(largest, ida_projection::left_of_dropped(*block, n_, [&](int i) {
                         return in_tolerances(*block, i, WT);
                       }));
  return largest;
}

void RowBlocks::weigh_dropped(const std::vector<double>& WT) {
  for (Block* block : {&d, &a})
    ida_projection::weigh_dropped(*block, n_, [&](int i) { return in_tolerances(*block, i, WT); });
}

}  // namespace tether::ida_projection
