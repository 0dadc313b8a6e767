// Tether: C, and its rows split into those for differential and for algebraic variables (method,
// eq. 14). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/linalg/minimum_norm.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <vector>

#include "constraints/evaluator.hpp"
#include "rows/row_levels.hpp"
#include "rows/row_trust.hpp"

namespace tether::ida_projection {

/// The m rows of C on n unknowns: rows with a sparse pattern, and full rows of n entries. For full
/// rows it records which entries were ever seen to differ from zero.
class StoredRows {
 public:
  /// `sparse`: sets with a SparseJacobian keep their pattern; otherwise every row is full.
  StoredRows(const Evaluator& evaluator, int n, bool sparse);

  bool sparse() const { return sparse_; }
  bool full(int i) const { return row(i).full; }
  /// All entries; where every row is full, C(i, j) is values()[i n + j].
  const std::vector<double>& values() const { return values_; }
  /// The entries of row i.
  const double* entries(int i) const { return values_.data() + row(i).begin; }
  /// f(column, entry) for the entries of row i; of full rows for those that are not zero.
  template <class Visit>
  void visit(int i, Visit f) const {
    const Row& at = row(i);
    const double* c = values_.data() + at.begin;
    if (!at.full) {
      const int* const column = columns_.data() + at.begin;
      for (int e = 0; e < at.count; ++e) f(column[e], c[e]);
      return;
    }
    for (int e = 0; e < at.count; ++e)
      if (c[e] != 0.0) f(e, c[e]);
  }
  /// f(column, entry of values(), was it ever seen not to be zero?) for each place of row i.
  template <class Visit>
  void visit_places(int i, Visit f) const {
    const Row& at = row(i);
    for (int k = 0; k < at.count; ++k) {
      const auto e = static_cast<std::size_t>(at.begin + k);
      f(at.full ? k : columns_[e], e, seen_[e] != 0);
    }
  }
  /// sum_j |C_ij y_j| and sum_j C_ij y_j.
  double terms(int i, const double* y) const;
  double times(int i, const double* y) const;
  /// The columns of these rows that can differ from zero.
  RowPattern pattern(const std::vector<int>& of_rows) const;

  /// C at y; differences visit `columns`. g: null, or receives the values, too.
  TETHER_INLINE Status evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                                const std::vector<int>& columns, double* g) {
    return sparse_ ? evaluator.entries(t, y, n_, WT, columns, values_.data(),
                                       values_.data() + columns_.size(), g)
                   : evaluator.jacobian(t, y, n_, WT, columns, values_.data(), g);
  }
  void forget_seen() { seen_.assign(values_.size(), 0); }
  void notice(int i, int j) { seen_[static_cast<std::size_t>(row(i).begin + j)] = 1; }
  void notice_all();
  /// Records which of these entries, unseen so far, are not zero. Returns whether any is.
  bool notice(const std::vector<std::size_t>& entries);
  bool has_seen(const std::vector<std::size_t>& entries) const;

 private:
  struct Row {
    int begin, count;
    bool full;
  };
  const Row& row(int i) const { return rows_[static_cast<std::size_t>(i)]; }

  int n_;
  bool sparse_;
  std::vector<Row> rows_;
  std::vector<int> columns_;    // of the entries of sparse rows, which come first
  std::vector<double> values_;  // C
  std::vector<char> seen_;      // not to be zero
};

/// One set of rows solved for one set of columns, by dense factors or by sparse ones.
struct Block {
  std::vector<int> rows, columns;
  linalg::MinimumNorm dense;
  std::unique_ptr<linalg::SparseMinimumNorm> sparse;  // null: dense factors
  std::vector<int> gather;                            // entry of C of each sparse entry
  std::vector<double> g, dy;
  double least_independent = 1.0;  // sine of the angle of a row with those before it
  int first = -1;  // of columns that follow each other without a gap; -1: they do not

  /// f(solver in use).
  template <class Use>
  auto solver(Use f) const {
    return sparse ? f(*sparse) : f(dense);
  }
  int rank() const {
    return solver([](const auto& factors) { return factors.rank(); });
  }
  double* D() { return sparse ? sparse->metric() : dense.metric(); }
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
  bool contains(int j) const;
  void set_up(const StoredRows& C, int n);
  /// From C and the metric in D(). False: an entry is not finite.
  bool factor(const StoredRows& C, int n, double rank_tolerance);
  /// The same with the rows that the last factor() has kept, by dense factors. False: it is due.
  TETHER_INLINE bool factor_kept(const StoredRows& C, int n) {
    return rows.empty() || dense.factor_kept(C.values().data(), n, rows.data(), columns.data());
  }
  void solve();
};

/// C dy = g in minimum norm, in two stages: rows without algebraic variables ("A") move the
/// differential columns ("d"); then rows that contain algebraic variables ("B") are solved for
/// these columns ("a") alone, so that no position or velocity is bent to repair a multiplier.
/// If no variable is algebraic, B is empty and this is one minimum-norm solve.
class SplitRows {
 public:
  SplitRows(const Constraints& constraints, Evaluator& evaluator, int n, bool sparse);

  Block d, a;
  /// f(block) for those that have rows.
  template <class Body>
  void for_blocks(Body&& f) {
    if (!d.rows.empty()) f(d);
    if (!a.rows.empty()) f(a);
  }
  /// The rows whose move is measured in tolerances.
  Block& counted() { return d.rows.empty() ? a : d; }
  const StoredRows& C() const { return C_; }
  int rank() const { return d.rank() + a.rank(); }

  /// Finds A, B, d and a from the entries that C can fill: those not zero at y or at a point some
  /// tolerances away, so that a velocity that happens to be zero is not taken for a structural
  /// zero. `id`: 1 differential, 0 algebraic, null: none algebraic.
  Status structure(double t, const std::vector<double>& y, const std::vector<double>& WT,
                   const std::vector<bool>& hold, const double* id);
  bool structured() const { return structured_; }
  /// For each row: it is an equation of F, which determines its algebraic variables. It is solved
  /// for these however small their part in it is. Empty: none is.
  void set_equations(const std::vector<char>& of_F) { of_F_ = of_F; }
  /// Whether evaluate() needs WT.
  bool needs_WT() const { return evaluator_.uses_differences() || !mixed_.empty(); }

  /// C at y; g: null, or receives the values, too. If an entry that structure() took for zero
  /// belongs to another block or to none, the rows are arranged anew: `rearranged()` then fills D.
  template <class Rearranged>
  TETHER_INLINE Status evaluate(double t, const double* y, const double* WT, double* g,
                                Rearranged rearranged) {
    const Status status = C_.evaluate(evaluator_, t, y, WT, columns_, g);
    if (status != Status::success || !structured_ || (mixed_.empty() && watched_.empty()))
      return status;
    inspect(t, y, WT);
    if (!outgrown_) return status;
    rearrange();
    rearranged();
    const Status again = C_.evaluate(evaluator_, t, y, WT, columns_, nullptr);
    if (again == Status::success) inspect(t, y, WT);
    return again;
  }
  /// A move failed: perhaps entries of C are missing that g could not fill before.
  void refresh_pattern_soon() { next_refresh_ = 0; }
  /// D of all unknowns, for the next factor().
  template <class Metric>
  void set_metric(Metric D) {
    for_blocks([&D](Block& block) {
      block.for_columns([D, to = block.D()](int k, int j) { to[k] = D(j); });
    });
  }
  /// From C and the metric. False: an entry is not finite.
  bool factor();
  /// The same with the rows that the last factor() has kept. False: it is due.
  TETHER_INLINE bool factor_kept() {
    return !C_.sparse() && d.factor_kept(C_, n_) && a.factor_kept(C_, n_);
  }
  /// d.dy and a.dy for the values g, with the C that was factored.
  TETHER_INLINE void solve(const std::vector<double>& g) {
    if (a.rows.empty() && !d.sparse)
      d.dense.solve(g.data(), d.dy.data());  // d has every row, in order
    else
      solve_blocks(g);
  }
  bool drops_rows() const;
  /// Whether, if none is dropped, they determine as many algebraic variables, and nothing else.
  bool leave_no_choice() const { return d.rows.empty() && a.rows.size() == a.columns.size(); }
  /// Whether inspect() has nothing to look for.
  bool keeps_blocks() const { return watched_.empty() && mixed_.empty(); }
  /// dy of every column that moves.
  template <class Body>
  void for_moves(Body&& body) {
    for_blocks([&body](const Block& block) {
      block.for_columns([&body, dy = block.dy.data()](int k, int j) { body(j, dy[k]); });
    });
  }

  /// After a move of this length: evaluates C at y if its turn is to be measured.
  Status learn_trust(double t, const double* y, const double* WT, double length);
  RowTrust trust;

  /// After solve(): length of the move that dropped rows ask for beyond the kept ones, in
  /// tolerances.
  double left_of_dropped(const std::vector<double>& WT) const;
  /// Whether that is more than half a tolerance; the report names them then.
  bool contradict(const std::vector<double>& WT);

 private:
  void inspect(double t, const double* y, const double* WT);
  void solve_blocks(const std::vector<double>& g);
  Status find_seen(double t, const std::vector<double>& y, const std::vector<double>& WT);
  void rearrange();
  void split();
  void watch();
  bool algebraic(int j) const { return !id_.empty() && id_[static_cast<std::size_t>(j)] == 0.0; }
  bool held(int j) const { return !hold_.empty() && hold_[static_cast<std::size_t>(j)]; }

  const Constraints& constraints_;
  Evaluator& evaluator_;
  int m_, n_;
  double rank_tolerance_;
  StoredRows C_;
  std::vector<double> C_after_;  // work space of learn_trust()
  std::vector<int> columns_;     // every column that C can fill and that is free
  std::vector<double> moved_;    // d.dy at its columns, 0 elsewhere; where B exists
  std::vector<bool> hold_;
  std::vector<double> id_;            // empty: none algebraic
  std::vector<int> mixed_;            // rows that contain unknowns of both kinds
  std::vector<char> of_F_;            // of each row: it is an equation of F; empty: none
  std::vector<char> without_;         // of each row: its algebraic part is next to nothing
  std::vector<std::size_t> watched_;  // entries that would change the blocks, zero so far
  long evaluations_ = 0, next_refresh_ = 0;
  bool outgrown_ = false, structured_ = false;
};

/// y moved by some tolerances in no special direction: a velocity that happens to be zero at y is
/// not zero there. WT = 0: unweighted.
std::vector<double> some_tolerances_away(std::vector<double> y, const std::vector<double>& WT);

}  // namespace tether::ida_projection
