// Tether: the rows of C split into those for differential and for algebraic variables (method, eq.
// 14). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/linalg/minimum_norm.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <type_traits>
#include <vector>

#include "rows/block.hpp"
#include "rows/kinds_of_unknowns.hpp"
#include "rows/row_trust.hpp"
#include "rows/stored_rows.hpp"

namespace tether::ida_projection {

/// When to find out again which entries of C differences have to visit: at the evaluations of C
/// number 16, 32, 64, ..., and at the next one after a failure.
class PatternRefresh {
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
/// If no variable is algebraic, B is empty and this is one minimum-norm solve. `Solver`:
/// linalg::MinimumNorm for full rows, linalg::SparseMinimumNorm for sparse ones and full ones after
/// them.
template <class Solver>
class SplitRows {
 public:
  using Block = BlockOf<Solver>;
  /// Pivots of dense rows tell which are independent and which need RowTrust. Rows that are known
  /// to be independent have factors that cost half or less.
  static constexpr bool kDense = std::is_same_v<Solver, linalg::MinimumNorm>;

  SplitRows(const Constraints& constraints, const Evaluator& evaluator, int n);

  Block d, a;

  /// Finds A, B, d and a from the entries that C can fill: those not zero at y or at a point some
  /// tolerances away, so that a velocity that happens to be zero is not taken for a structural
  /// zero. `id`: 1 differential, 0 algebraic, null: none algebraic.
  Status structure(Evaluator& evaluator, double t, const std::vector<double>& y,
                   const std::vector<double>& WT, const std::vector<bool>& hold, const double* id);
  bool structured() const { return structured_; }
  /// After structure(): which entries of these rows of C can differ from zero.
  RowPattern pattern(const std::vector<int>& of_rows) const { return C_.pattern(of_rows); }
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
  /// A move failed: perhaps entries of C are missing that g could not fill before.
  void refresh_pattern_soon() { refresh_.soon(); }
  /// D of all unknowns, for the next factor().
  void set_metric(const double* D) {
    for (Block* block : {&d, &a})
      if (!block->rows.empty())
        block->for_columns([D, to = block->D()](int k, int j) { to[k] = D[j]; });
  }
  /// From C and the metric in d.D() and a.D(). False: an entry is not finite.
  bool factor();
  /// The same with the rows that the last factor() has kept. False: factor() is due.
  bool factor_kept();
  /// d.dy and a.dy for the values g, with the C that was factored.
  void solve(const std::vector<double>& g);
  int rank() const { return d.solver.rank() + a.solver.rank(); }
  /// The rows whose move is measured in tolerances.
  Block& counted() { return d.rows.empty() ? a : d; }
  /// After a move of this length: evaluates C at y if its turn is to be measured.
  Status learn_trust(Evaluator& evaluator, double t, const double* y, const double* WT,
                     double length);
  RowTrust trust;
  bool dropped_rows() const { return d.solver.dropped() > 0 || a.solver.dropped() > 0; }

  /// sum_j |C_ij y_j| and sum_j C_ij y_j.
  double terms(int i, const double* y) const;
  double times(int i, const double* y) const;
  /// f(column, entry) for the entries of row i.
  template <class Visit>
  void visit_row(int i, Visit f) const {
    C_.visit(i, f);
  }

  /// After solve(): length of the move that dropped rows ask for beyond the kept ones, in
  /// tolerances.
  double left_of_dropped(const std::vector<double>& WT) const;
  /// Whether that length is too large; names the rows then.
  bool contradict(const std::vector<double>& WT);

  Contradiction contradiction;
  std::string message;

 private:
  /// Part of a move that an iterative solution may leave to Newton's next step.
  static constexpr double kSolved = 1e-6;

  Status find_seen(Evaluator& evaluator, double t, const std::vector<double>& y,
                   const std::vector<double>& WT);
  void extend_pattern(Evaluator& evaluator, double t, const double* y, const double* WT);
  void split();
  void watch();
  void set_up(Block& block, std::vector<int>* gather);
  bool factor(Block& block, const std::vector<int>& gather);
  void solve_block(Block& block);
  LeftOfDropped most_left(const Block& block, const std::vector<double>& WT) const;

  const Constraints& constraints_;
  int m_, n_;
  double rank_tolerance_;
  StoredRows C_;
  std::vector<double> C_after_;           // work space of learn_trust()
  std::vector<int> columns_;              // every column that C can fill and that is free
  std::vector<int> gather_d_, gather_a_;  // entry of C of each sparse entry of a block
  std::vector<double> moved_;             // d.dy at its columns, 0 elsewhere; where B exists
  KindsOfUnknowns kinds_;
  std::vector<std::size_t> watched_;  // entries that would change the blocks, zero so far
  PatternRefresh refresh_;
  bool outgrown_ = false;
  bool structured_ = false;
};

using DenseRows = SplitRows<linalg::MinimumNorm>;
using SparseRows = SplitRows<linalg::SparseMinimumNorm>;
extern template class SplitRows<linalg::MinimumNorm>;
extern template class SplitRows<linalg::SparseMinimumNorm>;

}  // namespace tether::ida_projection
