// Tether: g, C and its factors at a candidate. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "constraints/evaluator.hpp"
#include "movers/loaded_candidate.hpp"
#include "movers/local_metric.hpp"
#include "rows/rounding.hpp"
#include "rows/split_rows.hpp"

namespace tether::ida_projection {

constexpr int kFewForLevels = 16;  // rows
constexpr double kSafe = 0.25;     // of Options::tolerance, where old factors tell what is left

/// The uses of the factors at hand.
struct FactorState {
  bool there = false;    ///< of this candidate or of an earlier one
  bool thin = false;     ///< the last factor() found rows that need RowTrust
  bool lasting = false;  ///< which rows it has kept is right for the next steps, too
  bool decided = false;  ///< it found that out for this candidate
  bool partial = false;  ///< independent rows are left out, too thin to be trusted
  bool foreign = false;  ///< the caller's rows are others now
};

/// A candidate and the rows there: evaluates them, factors C in the metric and solves. It decides
/// nothing about the sequence of moves. `Rows` keeps C and its factors: DenseRows or SparseRows.
template <class Rows>
class FactoredRows {
 public:
  /// Drift is that of the first `reported` rows (-1: of all). What failed is told in `message`.
  FactoredRows(const Constraints& constraints, const Options& options, Statistics& statistics,
               int size, int reported, std::string& message)
      : evaluator(constraints, statistics),
        blocks(constraints, evaluator, size),
        at(size),
        metric(options, size),
        options_(options),
        statistics_(statistics),
        message_(message),
        reported_(reported >= 0 ? reported : evaluator.rows()),
        inverse_n_(1.0 / size) {
    g_.assign(static_cast<std::size_t>(evaluator.rows()), 0.0);
    kept_g_ = rounding_ = g_;
  }

  Evaluator evaluator;
  Rows blocks;
  LoadedCandidate at;
  LocalMetric metric;
  FactorState factors;

  int count() const { return static_cast<int>(g_.size()); }
  int reported() const { return reported_; }
  /// Norm for a sum of squares over some of the N columns.
  double wrms(double sum) const { return std::sqrt(sum * inverse_n_); }
  void set_metric(bool for_factors) {
    if (for_factors)
      metric.fill(at, blocks.d, blocks.a);
    else
      metric.look(at);
  }
  /// One scale for each level of the columns from now on. False: there is one level only.
  bool find_levels();
  /// At the candidate, whose variables are algebraic where `id` is 0.
  Status structure(const Candidate& candidate, const double* id);
  /// g at the present y.
  Status value(double t) {
    rows_known_ = false;
    const Status status = evaluator.value(t, at.y.data(), unknowns(), g_.data());
    if (status != Status::success) message_ = evaluator.message();
    return status;
  }
  /// The same where C will be wanted, too.
  Status value_with_rows(double t);
  /// C at the present y, and its factors.
  Status factor(double t);
  /// The move for g by the factors at hand; returns its WRMS length in the error norm. Algebraic
  /// columns do not count there: they follow the others, and out of the error test.
  double solve() {
    blocks.solve(g_);
    return length_of_solution();
  }
  /// The same with as many steps as the factors need for rows that they cannot tell from dependent
  /// ones.
  double solve_closely() {
    blocks.solve_closely(g_);
    return length_of_solution();
  }
  /// The rows whose move is measured in tolerances.
  typename Rows::Block& counted() { return blocks.d.rows.empty() ? blocks.a : blocks.d; }
  /// The same where no move follows.
  double look() {
    --statistics_.iterations;
    return solve();
  }
  /// The first solve() after factor(): decides which of the thin rows take part until the next one.
  double first_solve();
  /// The same with set_metric() and factor() before it, of few rows that are known to be
  /// independent: in one pass. `solved` is false where they are not; then nothing is done that
  /// these would not do again.
  Status quick_solve(double t, bool& solved, double& length);
  /// y and the correction move by -factor dy.
  void apply(double factor, double* correction);
  /// After the first move, of this length: by how much has C turned?
  Status learn_trust(double t, double length);

  /// After solve(): do the rows that were dropped follow from the others? Rows that an earlier step
  /// has dropped are satisfied only while they depend on the others; where they ask for more than
  /// they did then, one may have become independent.
  bool dropped_follow();
  bool contradicts();
  double drift() const;
  bool rounding_only() const;
  double rounding_length();
  void reset() {
    factors.there = false;
    metric.reset();
    if constexpr (Rows::kThinRows) blocks.trust.reset();
    usual_ = 0.0;
    factored_ = rate_looks_ = 0;
    levels_known_ = false;
  }

 private:
  double length_of_solution();
  bool only_rounding(std::size_t i) const;
  using Block = typename Rows::Block;

  static void take(double factor, const double* __restrict dy, int n, double* __restrict ycor,
                   double* __restrict y) {
    for (int k = 0; k < n; ++k) {
      const double move = factor * dy[k];
      ycor[k] -= move;
      y[k] -= move;
    }
  }
  int unknowns() const { return static_cast<int>(at.y.size()); }
  Status rows(double t, double* g);
  bool decide();
  const std::vector<int>& levels();
  void look_for_rates();
  bool first_are_rates_of_zeroth(const std::vector<int>& levels);
  double left_of_dropped();

  const Options& options_;
  Statistics& statistics_;
  std::string& message_;
  int reported_;  // the others are equations of F
  double inverse_n_;
  std::vector<double> g_;
  std::vector<double> kept_g_, rounding_;  // work space of rounding_length()
  bool rows_known_ = false;                // C belongs to the present y
  int factored_ = 0, rate_looks_ = 0;
  std::vector<int> found_levels_;
  bool levels_known_ = false;  // they are those of the rows as they are arranged
  double usual_ = 0.0;         // left_of_dropped() after the moves, with factors.decided
};

template <class Rows>
double FactoredRows<Rows>::length_of_solution() {
  ++statistics_.iterations;
  double sum = 0.0;
  const Block& block = counted();
  block.for_columns([&sum, dy = block.dy.data(), w = at.w](int k, int i) {
    const double move = dy[k] * w[i];
    sum += move * move;
  });
  return wrms(sum);
}

// After solve(): the largest distance, in tolerances, that the dropped rows ask for beyond the
// others.
template <class Rows>
double FactoredRows<Rows>::left_of_dropped() {
  if (!blocks.dropped_rows()) return 0.0;
  const double left = blocks.left_of_dropped(at.WT());
  if (factors.decided) usual_ = left;
  return left;
}

template <class Rows>
bool FactoredRows<Rows>::dropped_follow() {
  const double allowed = std::max(kSafe * options_.advanced.tolerance, 2.0 * usual_);
  const double left = left_of_dropped();
  if (factors.decided || left <= allowed) return true;
  return left <= 1e2 * kEpsilon * at.size();
}

template <class Rows>
void FactoredRows<Rows>::apply(double factor, double* correction) {
  if (const Block& d = blocks.d; blocks.a.rows.empty() && d.first >= 0)
    return take(factor, d.dy.data(), static_cast<int>(d.columns.size()), correction + d.first,
                at.y.data() + d.first);
  for (const Block* block : {&blocks.d, &blocks.a}) {
    if (block->rows.empty()) continue;
    if (block->first >= 0)
      take(factor, block->dy.data(), static_cast<int>(block->columns.size()),
           correction + block->first, at.y.data() + block->first);
    else
      block->for_columns([=, y = at.y.data(), dy = block->dy.data()](int k, int i) {
        correction[i] -= factor * dy[k];
        y[i] -= factor * dy[k];
      });
  }
}

template <class Rows>
double FactoredRows<Rows>::drift() const {
  double largest = 0.0;
  for (int i = 0; i < reported_; ++i)
    largest = std::max(largest, std::abs(g_[static_cast<std::size_t>(i)]));
  return largest;
}

}  // namespace tether::ida_projection
