// Tether: RowBlocks for sparse rows. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <vector>

#include "rows/row_blocks.hpp"

namespace tether::ida_projection {

/// C with rows that keep a sparse pattern and rows of n entries.
struct StoredRows {
  /// Row i of C: entries begin .. end - 1, or full row `full` >= 0.
  struct Row {
    int begin = 0, end = 0, full = -1;
  };

  StoredRows(const Evaluator& evaluator, int n);

  /// f(column, entry) for the entries of row i.
  template <class Visit>
  void visit(int i, Visit f) const {
    const Row& row = rows[static_cast<std::size_t>(i)];
    for (int e = row.begin; e < row.end; ++e)
      f(columns[static_cast<std::size_t>(e)], entries[static_cast<std::size_t>(e)]);
    if (row.full < 0) return;
    const double* from = full_row(row.full);
    for (int j = 0; j < n_; ++j) f(j, from[j]);
  }
  /// Can column j of the row differ from zero, as far as seen?
  bool fills(const Row& row, int j) const {
    return row.full < 0 || full_fills[place(row.full, j)] != 0;
  }
  void notice(int i, int j) { full_fills[place(rows[static_cast<std::size_t>(i)].full, j)] = 1; }
  std::size_t place(int full, int j) const {
    return static_cast<std::size_t>(full) * static_cast<std::size_t>(n_) +
           static_cast<std::size_t>(j);
  }
  const double* full_row(int full) const { return full_entries.data() + place(full, 0); }

  std::vector<Row> rows;
  std::vector<int> columns;                   ///< of every sparse entry
  std::vector<double> entries, full_entries;  ///< C
  std::vector<char> entry_fills, full_fills;  ///< which of these can differ from zero

 private:
  int n_;
};

/// The two stages of RowBlocks with sparse factors. Rows with a SparseJacobian keep their pattern;
/// all others are full rows. A block's rows are the sparse ones first. Members as in RowBlocks.
class SparseRows {
 public:
  using Block = BlockOf<linalg::SparseMinimumNorm>;
  /// C and its factors cost four solves and more: they serve several steps. Of few rows nothing
  /// would be gained that makes up for a metric of an earlier step.
  static bool keeps_factors(int rows) { return rows > 64; }
  static constexpr bool kKeepsRank = false;
  static bool many(int) { return false; }
  static constexpr bool kThinRows = false;

  SparseRows(const Constraints& constraints, const Evaluator& evaluator, int n);

  Block d, a;

  Status structure(Evaluator& evaluator, double t, const std::vector<double>& y,
                   const std::vector<double>& WT, const std::vector<bool>& hold, const double* id);
  bool structured() const { return structured_; }
  RowPattern pattern(const std::vector<int>& of_rows) const;
  bool split_by_level(const std::vector<int>& levels, int first);
  void join_levels();
  bool split_levels() const { return kinds_.by_level(); }
  bool mixed() const { return !kinds_.mixed.empty(); }
  Status evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                  double* g = nullptr);
  bool outgrown() const { return outgrown_; }
  void rearrange();
  void look_again_soon() { look_.soon(); }
  bool factor();
  bool factor_kept() { return false; }
  void solve(const std::vector<double>& g) { solve(g, kSolved); }
  /// One step with the regularised factors, where the next solve takes the rest.
  void solve_roughly(const std::vector<double>& g) { solve(g, 1.0); }
  void solve_closely(const std::vector<double>& g) {
    solve(g, linalg::SparseMinimumNorm::kTolerance);
  }
  int rank() const { return d.solver.rank() + a.solver.rank(); }
  bool dropped_rows() const { return d.solver.dropped() > 0 || a.solver.dropped() > 0; }
  double terms(int i, const double* y) const;
  double times(int i, const double* y) const;
  bool contradict(const std::vector<double>& WT);
  void weigh_dropped(const std::vector<double>& WT);
  double left_of_dropped() const {
    return std::max(ida_projection::left_of_dropped(d), ida_projection::left_of_dropped(a));
  }
  double left_of_dropped(const std::vector<double>& WT) const;
  /// f(column, entry) for the entries of row i.
  template <class Visit>
  void visit_row(int i, Visit f) const {
    C_.visit(i, f);
  }

  Contradiction contradiction;
  std::string message;

 private:
  static constexpr double kSolved = 1e-6;  // of g: Newton's next move takes the rest

  void solve(const std::vector<double>& g, double solved);
  double in_tolerances(const Block& block, int i, const std::vector<double>& WT) const;
  Status find_full_columns(Evaluator& evaluator, double t, const std::vector<double>& y,
                           const std::vector<double>& WT);
  void look_beyond(Evaluator& evaluator, double t, const double* y, const double* WT);
  void split();
  void watch();
  void set_up(Block& block, std::vector<int>* gather);
  void load(Block& block, const std::vector<int>& gather);

  const Constraints& constraints_;
  int m_, n_;
  StoredRows C_;
  std::vector<int> columns_;              // every column that differences must visit
  std::vector<int> gather_d_, gather_a_;  // entry of C of each entry of a block
  std::vector<double> moved_;             // d.dy at its columns, 0 elsewhere; where B exists
  KindsOfUnknowns kinds_;
  // Entries, zero so far, that would change the blocks: of the sparse rows and of the full ones.
  std::vector<std::size_t> watched_entries_, watched_full_;
  LookAgain look_;
  bool outgrown_ = false;
  bool structured_ = false;
};

}  // namespace tether::ida_projection
