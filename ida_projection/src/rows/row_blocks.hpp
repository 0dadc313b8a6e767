// Tether: the rows of C split into those for differential and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tether/linalg/filled.hpp>
#include <tether/linalg/minimum_norm.hpp>
#include <vector>

#include "attach/shortest.hpp"
#include "constraints/evaluator.hpp"
#include "rows/kinds_of_unknowns.hpp"
#include "rows/rounding.hpp"
#include "rows/row_chain.hpp"
#include "rows/row_trust.hpp"

namespace tether::ida_projection {

/// One set of rows solved for one set of columns.
template <class Solver>
struct BlockOf {
  std::vector<int> rows, columns;
  Solver solver;
  std::vector<double> g, dy;
  int first = -1;  // of columns that follow each other without a gap; -1: they do not
  std::vector<double> tolerances;  // of each row, once it is dropped, for a distance of 1

  /// After rows, columns and the solver were set up.
  void resize() {
    g.assign(rows.size(), 0.0);
    dy.assign(columns.size(), 0.0);
    tolerances.assign(rows.size(), 0.0);
    const bool adjacent = !columns.empty() &&
                          columns.back() - columns.front() + 1 == static_cast<int>(columns.size());
    first = adjacent ? columns.front() : -1;
  }

  double* D() { return solver.metric(); }
  void solve() { solver.solve(g.data(), dy.data()); }

  /// body(k, j) for each column j = columns[k]. Adjacent columns make a plain loop, which the
  /// compiler can turn into vector code.
  template <class Body>
  void for_columns(Body&& body) const {
    const int count = static_cast<int>(columns.size());
    if (first >= 0) {
      for (int k = 0; k < count; ++k) body(k, first + k);
    } else {
      for (int k = 0; k < count; ++k) body(k, columns[static_cast<std::size_t>(k)]);
    }
  }
};

/// Dropped rows of a block that contradict its kept rows.
struct Contradiction {
  std::vector<int> rows;
  std::string message;
};

/// Part of a tolerance: a move of that size cannot make rows contradict each other by more.
constexpr double kContradiction = 0.5;

/// After solve(): do dropped rows of the block ask for what the kept ones exclude? Up to what a
/// tolerance-size move explains, they must follow from them. in_tolerances(row): |row_i(C WT)| over
/// the block's columns. n: unknowns.
template <class Solver, class Norm>
bool contradicts(const BlockOf<Solver>& block, const Constraints& constraints, int n,
                 Norm in_tolerances, Contradiction* found) {
  const Solver& solver = block.solver;
  for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k) {
    const int row = block.rows[static_cast<std::size_t>(solver.pivot(k))];
    const double norm = solver.row_norm(solver.pivot(k));
    const double row_in_tolerances = in_tolerances(row);
    const bool vanished = !(norm > std::numeric_limits<double>::min());
    const double left = solver.inconsistency(k) * (vanished ? 1.0 : norm);
    const double allowed =
        vanished ? 1e-12
                 : kContradiction * std::sqrt(n) * row_in_tolerances + 1e2 * kEpsilon * norm;
    if (left <= allowed) continue;

    found->rows = {row};
    if (vanished) {
      found->message =
          constraints.name(row) + ": the gradient vanishes although g = " + brief(left);
      return true;
    }
    const std::vector<double> share = solver.dependence(k);
    for (int i = 0; i < solver.rank(); ++i)
      if (std::abs(share[static_cast<std::size_t>(i)]) > 1e-3)
        found->rows.push_back(block.rows[static_cast<std::size_t>(solver.pivot(i))]);
    std::sort(found->rows.begin(), found->rows.end());
    found->message = "rows contradict each other:";
    for (int i : found->rows)
      found->message += " " + std::to_string(i) + " (" + constraints.name(i) + ")";
    found->message += "; a distance of " +
                      brief(left / (std::sqrt(n) * std::max(row_in_tolerances, 1e-300))) +
                      " tolerances stays unsolved";
    return true;
  }
  return false;
}

/// weight(k, i, tolerances in a unit of its inconsistency) for each dropped row, k in pivot order,
/// i in the block, with the present factors; other arguments as of contradicts().
template <class Solver, class Norm, class Weight>
void visit_dropped(const BlockOf<Solver>& block, int n, Norm in_tolerances, Weight weight) {
  const Solver& solver = block.solver;
  for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k) {
    const auto i = static_cast<std::size_t>(solver.pivot(k));
    const double norm = solver.row_norm(solver.pivot(k));
    const bool vanished = !(norm > std::numeric_limits<double>::min());
    // A row that vanishes has no distance: what contradicts() tolerates stands for one tolerance.
    weight(
        k, i,
        vanished ? 1e12 : norm / (std::sqrt(n) * std::max(in_tolerances(block.rows[i]), 1e-300)));
  }
}

/// Before left_of_dropped().
template <class Solver, class Norm>
void weigh_dropped(BlockOf<Solver>& block, int n, Norm in_tolerances) {
  visit_dropped(block, n, in_tolerances,
                [&](int, std::size_t i, double weight) { block.tolerances[i] = weight; });
}

/// After solve(): the largest inconsistency of a dropped row, in tolerances.
template <class Solver>
double left_of_dropped(const BlockOf<Solver>& block) {
  const Solver& solver = block.solver;
  double largest = 0.0;
  for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k)
    largest = std::max(largest, solver.inconsistency(k) *
                                    block.tolerances[static_cast<std::size_t>(solver.pivot(k))]);
  return largest;
}

/// Not less than that: no row is longer in the metric than in tolerances by more than `ratio`.
template <class Solver>
double most_left_of_dropped(const BlockOf<Solver>& block, int n, double ratio) {
  const Solver& solver = block.solver;
  double largest = 0.0;
  for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k)
    largest = std::max(largest, solver.inconsistency(k));
  return largest == 0.0 ? 0.0 : largest * ratio / std::sqrt(n);
}

/// That ratio: the largest D_j / WT_j of the block's columns. Dropped rows that vanish have none.
template <class Solver>
double most_of_metric(BlockOf<Solver>& block, const std::vector<double>& WT) {
  const Solver& solver = block.solver;
  for (int k = solver.rank(); k < static_cast<int>(block.rows.size()); ++k)
    if (!(solver.row_norm(solver.pivot(k)) > std::numeric_limits<double>::min()))
      return std::numeric_limits<double>::infinity();
  double largest = 0.0;
  const double* D = block.D();
  block.for_columns([&](int k, int j) {
    const double weight = WT[static_cast<std::size_t>(j)];
    largest =
        std::max(largest, weight > 0.0 ? D[k] / weight : std::numeric_limits<double>::infinity());
  });
  return largest;
}

/// The same where weigh_dropped() was not called.
template <class Solver, class Norm>
double left_of_dropped(const BlockOf<Solver>& block, int n, Norm in_tolerances) {
  double largest = 0.0;
  visit_dropped(block, n, in_tolerances, [&](int k, std::size_t, double weight) {
    largest = std::max(largest, block.solver.inconsistency(k) * weight);
  });
  return largest;
}

/// When to look again which entries of C differences have to visit, that is, which ones g can fill
/// by now: at the C evaluations number 16, 32, 64, ..., and with the next one after a failure.
class LookAgain {
 public:
  bool due() {
    if (++evaluations_ < next_) return false;
    next_ = std::max(kFirst, 2 * evaluations_);
    return true;
  }
  void soon() { next_ = 0; }

 private:
  static constexpr long kFirst = 16;
  long evaluations_ = 0, next_ = kFirst;
};

/// y moved by some tolerances in no special direction: a velocity that happens to be zero at y is
/// not zero there. WT = 0: unweighted.
std::vector<double> some_tolerances_away(std::vector<double> y, const std::vector<double>& WT);

/// C dy = g in minimum norm, in two stages: rows without algebraic variables ("A") move the
/// differential columns ("d"); then rows that contain algebraic variables ("B") are solved for
/// these columns ("a") alone, so that no position or velocity is bent to repair a multiplier.
/// If no variable is algebraic, B is empty and this is one minimum-norm solve. C is dense.
class RowBlocks {
 public:
  using Block = BlockOf<linalg::MinimumNorm>;
  /// Factors of the rows that an earlier step has kept are so cheap that none serve two steps.
  static bool keeps_factors(int) { return false; }
  /// Factors of rows that are known to be independent cost half of an orthogonal factorisation, and
  /// a tenth where rows are many. Then what Newton's method leaves is cheap to take, too.
  static constexpr bool kKeepsRank = true;
  static bool many(int rows) { return rows > 16; }
  /// The solver's pivots tell which rows need RowTrust.
  static constexpr bool kThinRows = true;

  RowBlocks(const Constraints& constraints, const Evaluator& evaluator, int n);

  Block d, a;

  /// Finds A, B, d and a from the entries that C can fill: those not zero at y or at a point some
  /// tolerances away, so that a velocity that happens to be zero is not taken for a structural
  /// zero. `id`: 1 differential, 0 algebraic, null: none algebraic.
  Status structure(Evaluator& evaluator, double t, const std::vector<double>& y,
                   const std::vector<double>& WT, const std::vector<bool>& hold, const double* id);
  bool structured() const { return structured_; }
  /// After structure(): which entries of these rows of C can differ from zero.
  RowPattern pattern(const std::vector<int>& of_rows) const;
  /// If none is algebraic, unknowns of level `first` and above (row_levels.hpp) take the place
  /// of algebraic ones. False: nothing has changed, they are not as many as their rows.
  bool split_by_level(const std::vector<int>& levels, int first);
  /// Back to one block.
  void join_levels();
  bool split_levels() const { return kinds_.by_level(); }
  /// Do rows contain variables of both kinds?
  bool mixed() const { return !kinds_.mixed.empty(); }

  /// C at y; WT: only differences and mixed rows need it. The text of a failure is the evaluator's.
  /// g: null, or receives the values, too.
  Status evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                  double* g = nullptr);
  /// Has evaluate() met an entry that structure() took for zero and that belongs to another block
  /// or to none? Then rearrange(), fill D and evaluate again.
  bool outgrown() const { return outgrown_; }
  void rearrange();
  /// A move failed: perhaps for want of entries that g could not fill before.
  void look_again_soon() { look_.soon(); }
  /// From C and the metric in d.D() and a.D(). False: an entry is not finite.
  bool factor();
  /// The same with the rows that the last factor() has kept. False: factor() is due.
  bool factor_kept() { return keep(d) && (a.rows.empty() || keep(a)); }
  /// d.dy and a.dy for the values g, with the C that was factored.
  void solve(const std::vector<double>& g) {
    if (a.rows.empty())
      d.solver.solve(g.data(), d.dy.data());  // then d has every row, in order
    else
      solve_both(g);
  }
  void solve_roughly(const std::vector<double>& g) { solve(g); }
  void solve_closely(const std::vector<double>& g) { solve(g); }
  int rank() const { return d.solver.rank() + a.solver.rank(); }
  /// Are these few rows over adjacent columns, none of them for algebraic variables?
  bool few() const { return few_; }
  /// factor_kept() of them.
  bool factor_kept_few() {
    return d.solver.factor_kept(C_.data(), n_, d.rows.data(), d.columns.data());
  }
  /// The rows whose move is measured in tolerances.
  Block& counted() { return d.rows.empty() ? a : d; }
  /// After a move of this length with the C at hand: C at y, where it is time to learn from it.
  Status learn_trust(Evaluator& evaluator, double t, const double* y, const double* WT,
                     double length);
  RowTrust trust;
  bool dropped_rows() const { return d.solver.dropped() > 0 || a.solver.dropped() > 0; }

  /// sum_j |C_ij y_j| and sum_j C_ij y_j.
  double terms(int i, const double* y) const;
  double times(int i, const double* y) const;
  /// f(column, entry) for the entries of row i that are not zero.
  template <class Visit>
  void visit_row(int i, Visit f) const {
    if (!zero_elsewhere_) return linalg::visit_filled(row(i), n_, f);
    const double* c = row(i);
    for (const int *j = places_.begin(i), *last = places_.end(i); j != last; ++j)
      if (c[*j] != 0.0) f(*j, c[*j]);
  }

  /// After solve(): as contradicts() above, for both blocks.
  bool contradict(const std::vector<double>& WT);
  void weigh_dropped(const std::vector<double>& WT);
  double left_of_dropped() const {
    return std::max(ida_projection::left_of_dropped(d), ida_projection::left_of_dropped(a));
  }
  double left_of_dropped(const std::vector<double>& WT) const;

  Contradiction contradiction;
  std::string message;

 private:
  bool keep(Block& block) {
    return block.rows.empty() ||
           block.solver.factor_kept(C_.data(), n_, block.rows.data(), block.columns.data(),
                                    zero_elsewhere_ ? &places_ : nullptr);
  }
  Status fill(Evaluator& evaluator, double t, const double* y, const double* WT, double* g);
  void solve_both(const std::vector<double>& g);
  double in_tolerances(const Block& block, int i, const std::vector<double>& WT) const;
  const double* row(int i) const { return C_.data() + static_cast<std::ptrdiff_t>(i) * n_; }
  double* row(int i) { return C_.data() + static_cast<std::ptrdiff_t>(i) * n_; }
  bool fills(int i, int j) const {
    return filled_[static_cast<std::size_t>(i) * static_cast<std::size_t>(n_) +
                   static_cast<std::size_t>(j)] != 0;
  }
  void notice(int i, int j) {
    filled_[static_cast<std::size_t>(i) * static_cast<std::size_t>(n_) +
            static_cast<std::size_t>(j)] = 1;
  }
  void look_beyond(Evaluator& evaluator, double t, const double* y, const double* WT);
  void watch();

  const Constraints& constraints_;
  int m_, n_;
  double rank_tolerance_;
  std::vector<double> C_;                    // m x n, row-major
  bool by_places_, zero_elsewhere_ = false;  // of C: the known places are all that is not zero
  linalg::FilledPlaces places_;
  std::vector<double> C_after_;  // work space of learn_trust()
  std::vector<int> columns_;     // every column that C can fill and that is free
  std::vector<char> filled_;     // m x n: entries seen not to be zero, or not constant
  KindsOfUnknowns kinds_;
  std::vector<std::size_t> watched_;  // entries of C that would change the blocks, zero so far
  LookAgain look_;
  bool outgrown_ = false;
  bool structured_ = false;
  bool few_ = false;
};

}  // namespace tether::ida_projection
