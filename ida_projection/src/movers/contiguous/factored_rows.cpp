// Tether: g, C and its factors at a candidate. SPDX-License-Identifier: BSD-3-Clause
#include "factored_rows.hpp"

#include <cstdint>

#include "attach/shortest.hpp"
#include "host/mechanisms.hpp"
#include "rows/row_levels.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kRoundedOneByOne = 32, kSignPatterns = 4;
constexpr int kLevelLooks = 16;
constexpr int kEarly = 64;       // factorisations, of a start
constexpr double kAlike = 0.05;  // of a sum of squares

}  // namespace

template <class Rows>
Status FactoredRows<Rows>::structure(const Candidate& candidate, const double* id) {
  factors.there = levels_known_ = false;
  const Status status = blocks.structure(evaluator, candidate.t, at.y, at.WT(), options_.hold, id);
  if (status != Status::success) message_ = blocks.message;
  return status;
}

// Level of each unknown in rows that are measured in tolerances; empty: there is one only. Not by
// the entries that are zero now: at rest those of positions in rows of velocities are.
template <class Rows>
const std::vector<int>& FactoredRows<Rows>::levels() {
  if (levels_known_) return found_levels_;
  found_levels_ = levels_of_columns(blocks.pattern(blocks.d.rows));
  if (*std::max_element(found_levels_.begin(), found_levels_.end()) < 1) found_levels_.clear();
  levels_known_ = true;
  return found_levels_;
}

template <class Rows>
bool FactoredRows<Rows>::find_levels() {
  if (levels().empty()) return false;
  metric.use_levels(levels());
  return true;
}

template <class Rows>
void FactoredRows<Rows>::look_for_rates() {
  const bool wanted = in_use(Mechanism::rate_limit) &&
                      options_.advanced.metric == Metric::local_correction && at.knows_rates();
  const bool early = factored_ <= kEarly && rate_looks_ < kLevelLooks;
  if (!wanted || metric.by_rates() || !early) return;
  ++rate_looks_;
  const std::vector<int>& found = levels();
  if (found.empty() || !first_are_rates_of_zeroth(found)) return;
  metric.use_rates(found);
  set_metric(true);
}

// Are as many unknowns and rows of level 1 as of level 0 there, and the unknowns as large as their
// rates? With an energy there is a row more, which at rest asks the positions.
template <class Rows>
bool FactoredRows<Rows>::first_are_rates_of_zeroth(const std::vector<int>& levels) {
  double rates = 0.0, values = 0.0;
  int more = 0, more_rows = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (levels[i] == 0) {
      rates += at.rate(i) * at.rate(i);
      ++more;
    } else if (levels[i] == 1) {
      values += at.y[i] * at.y[i];
      --more;
    }
  }
  for (const int i : blocks.d.rows) {
    int level = -1;
    blocks.visit_row(i, [&](int j, double entry) {
      if (entry != 0.0) level = std::max(level, levels[static_cast<std::size_t>(j)]);
    });
    more_rows += level == 0 ? 1 : level == 1 ? -1 : 0;
  }
  return more == 0 && more_rows == 0 && values > 0.0 && std::abs(rates - values) <= kAlike * values;
}

// C at the present y, and g if wanted.
template <class Rows>
Status FactoredRows<Rows>::rows(double t, double* g) {
  // Only differences and mixed rows need to know how large a tolerance is.
  const double* WT = evaluator.uses_differences() || blocks.mixed() ? at.WT().data() : nullptr;
  Status status = blocks.evaluate(evaluator, t, at.y.data(), WT, g);
  if (status == Status::success && blocks.outgrown()) {
    blocks.rearrange();
    factors.there = factors.lasting = levels_known_ = false;
    set_metric(true);
    status = blocks.evaluate(evaluator, t, at.y.data(), WT);
  }
  if (status != Status::success) message_ = evaluator.message();
  return status;
}

template <class Rows>
Status FactoredRows<Rows>::value_with_rows(double t) {
  if (!evaluator.gives_both()) return value(t);
  const Status status = rows(t, g_.data());
  rows_known_ = status == Status::success;
  return status;
}

template <class Rows>
Status FactoredRows<Rows>::factor(double t) {
  if (!rows_known_) {
    const Status status = rows(t, nullptr);
    if (status != Status::success) return status;
  }
  rows_known_ = false;
  factored_ = std::min(factored_ + 1, kEarly + 1);
  const bool known =
      in_use(Mechanism::kept_rank) && Rows::kKeepsRank && factors.lasting && factors.there;
  factors.there = false;
  if (known && blocks.factor_kept()) {
    factors.thin = false;
    ++statistics_.refactorizations;
  } else if (!decide()) {
    message_ = "the constraint Jacobian C has an entry that is not finite at t = " + brief(t);
    return Status::not_finite;
  }
  factors.there = true;
  factors.foreign = false;
  return Status::success;
}

template <class Rows>
Status FactoredRows<Rows>::quick_solve(double t, bool& solved, double& length) {
  solved = false;
  if constexpr (Rows::kThinRows) {
    const bool independent = factors.lasting && factors.there && !blocks.dropped_rows();
    if (!blocks.few() || !independent || !metric.plain()) return Status::success;
    if (!rows_known_) {
      const Status status = rows(t, nullptr);
      if (status != Status::success) return status;
      rows_known_ = true;
      if (!factors.there) return Status::success;
    }
    Block& d = blocks.d;
    const int columns = static_cast<int>(d.columns.size());
    metric.fill_few(at, d.first, columns, d.D());
    if (!blocks.factor_kept_few()) return Status::success;
    rows_known_ = factors.thin = factors.foreign = false;
    ++statistics_.refactorizations;
    ++statistics_.iterations;
    d.solver.solve(g_.data(), d.dy.data());
    const double *dy = d.dy.data(), *w = at.w + d.first;
    double sum = 0.0;
    for (int k = 0; k < columns; ++k) sum += (dy[k] * w[k]) * (dy[k] * w[k]);
    length = wrms(sum);
    solved = true;
  }
  return Status::success;
}

// Factors from which it can be seen which rows are independent. False: an entry is not finite.
template <class Rows>
bool FactoredRows<Rows>::decide() {
  ++statistics_.factorizations;
  factors.partial = false;
  if (count() > kFewForLevels) look_for_rates();
  if (!blocks.factor()) return false;
  if (blocks.dropped_rows()) ++statistics_.rank_drops;
  if constexpr (Rows::kThinRows)
    factors.thin = in_use(Mechanism::row_trust) && RowTrust::has_thin_rows(blocks.counted().solver);
  factors.lasting = !factors.thin;
  factors.decided = true;
  return true;
}

template <class Rows>
double FactoredRows<Rows>::first_solve() {
  const double length = solve();
  if constexpr (Rows::kThinRows) {
    if (!factors.thin) return length;
    linalg::MinimumNorm& solver = blocks.counted().solver;
    const int all = solver.rank();
    if (blocks.trust.trusted_rows(solver, length) == all) return length;
    const bool whole = !blocks.dropped_rows();
    // Nothing magnifies the right-hand side of the firm rows.
    const int firm = RowTrust::firm_rows(solver);
    solver.use_rank(firm);
    const double firm_length = solve();
    --statistics_.iterations;
    solver.use_rank(all);
    const int trusted = blocks.trust.trusted_rows(solver, firm_length);
    solver.use_rank(trusted);
    factors.lasting = RowTrust::lasting(solver, firm, trusted);
    factors.partial = trusted < all;
    if (whole && trusted < all) ++statistics_.rank_drops;
    if (trusted > firm) {
      --statistics_.iterations;
      return solve();
    }
    return firm_length;
  }
  return length;
}

template <class Rows>
Status FactoredRows<Rows>::learn_trust(double t, double length) {
  if constexpr (Rows::kThinRows) {
    if (!factors.thin) return Status::success;
    const double* WT = evaluator.uses_differences() ? at.WT().data() : nullptr;
    const Status status = blocks.learn_trust(evaluator, t, at.y.data(), WT, length);
    if (status != Status::success) message_ = evaluator.message();
    return status;
  }
  return Status::success;
}

template <class Rows>
bool FactoredRows<Rows>::contradicts() {
  if (!blocks.dropped_rows() || !blocks.contradict(at.WT())) return false;
  message_ = blocks.contradiction.message;
  return true;
}

// Does the rounding of its own terms explain g_i?
template <class Rows>
bool FactoredRows<Rows>::only_rounding(std::size_t i) const {
  return std::abs(g_[i]) <= 64.0 * kEpsilon * blocks.terms(static_cast<int>(i), at.y.data());
}

// Every g_i? Then there is nothing to enforce, however short the tolerances are that the metric
// would make of it.
template <class Rows>
bool FactoredRows<Rows>::rounding_only() const {
  for (std::size_t i = 0; i < g_.size(); ++i)
    if (!only_rounding(i)) return false;
  return true;
}

// Length of the move that the rounding of g asks for in the worst case, with the present factors:
// at most sum_i |dy_i|, dy_i the move for row i alone. Where that would take many solves it is
// bounded by sqrt(m sum_i |dy_i|^2), the sum of squares by moves for all rows with random signs.
template <class Rows>
double FactoredRows<Rows>::rounding_length() {
  kept_g_ = g_;
  const std::vector<double>& g = kept_g_;
  std::vector<double>& rounding = rounding_;
  for (int i = 0; i < count(); ++i)
    rounding[static_cast<std::size_t>(i)] = 8.0 * kEpsilon * blocks.terms(i, at.y.data());
  double total = 0.0;
  const auto add = [&](auto&& length) { total += length(solve()); };
  if (count() <= kRoundedOneByOne) {
    for (std::size_t i = 0; i < g.size(); ++i) {
      std::fill(g_.begin(), g_.end(), 0.0);
      g_[i] = rounding[i];
      add([](double length) { return length; });
    }
  } else {
    std::uint32_t random = 1;
    for (int pattern = 0; pattern < kSignPatterns; ++pattern) {
      for (std::size_t i = 0; i < g.size(); ++i) {
        random = 1664525u * random + 1013904223u;  // Numerical Recipes, section 7.1
        g_[i] = random >> 31 != 0 ? rounding[i] : -rounding[i];
      }
      add([](double length) { return length * length; });
    }
    total = std::sqrt(total / kSignPatterns * count());
  }
  g_ = g;
  return total;
}

template class FactoredRows<DenseRows>;
template class FactoredRows<SparseRows>;

}  // namespace tether::ida_projection
