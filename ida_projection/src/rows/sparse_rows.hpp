// Tether: RowBlocks for sparse rows. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <vector>

#include "rows/row_blocks.hpp"

namespace tether::ida_projection {

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
  bool mixed() const { return !mixed_.empty(); }
  Status evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                  double* g = nullptr);
  bool outgrown() const { return outgrown_; }
  void rearrange();
  void look_again_soon() { look_.soon(); }
  bool factor();
  bool factor_kept() { return false; }
  void solve(const std::vector<double>& g);
  int rank() const { return d.solver.rank() + a.solver.rank(); }
  bool dropped_rows() const { return d.solver.dropped() > 0 || a.solver.dropped() > 0; }
  double terms(int i, const double* y) const;
  double times(int i, const double* y) const;
  bool contradict(const std::vector<double>& WT);
  void weigh_dropped(const std::vector<double>& WT);
  double left_of_dropped() const {
    return std::max(ida_projection::left_of_dropped(d), ida_projection::left_of_dropped(a));
  }
  /// f(column, entry) for the entries of row i.
  template <class Visit>
  void visit_row(int i, Visit f) const {
    const Row& row = rows_[static_cast<std::size_t>(i)];
    for (int e = row.begin; e < row.end; ++e)
      f(columns_of_[static_cast<std::size_t>(e)], entries_[static_cast<std::size_t>(e)]);
    for (int j = 0; row.full >= 0 && j < n_; ++j)
      f(j, full_rows_[static_cast<std::size_t>(row.full) * static_cast<std::size_t>(n_) +
                      static_cast<std::size_t>(j)]);
  }

  Contradiction contradiction;
  std::string message;

 private:
  /// Where row i of C is: entries begin .. end - 1, or full row `full` >= 0.
  struct Row {
    int begin = 0, end = 0, full = -1;
  };
  template <class Visit>
  void visit(int i, Visit f) const;  // f(column, entry) of row i
  double in_tolerances(const Block& block, int i, const std::vector<double>& WT) const;
  Status find_full_columns(Evaluator& evaluator, double t, const std::vector<double>& y,
                           const std::vector<double>& WT);
  bool fills(const Row& row, int j) const;
  void look_beyond(Evaluator& evaluator, double t, const double* y, const double* WT);
  void split();
  void watch();
  bool loses_algebraic_part(int i, const double* WT) const;
  bool is_algebraic(int j) const { return !id_.empty() && id_[static_cast<std::size_t>(j)] == 0.0; }
  void set_up(Block& block, std::vector<int>* gather);
  void load(Block& block, const std::vector<int>& gather);

  const Constraints& constraints_;
  int m_, n_, full_ = 0;
  std::vector<Row> rows_;
  std::vector<int> columns_of_;              // of every sparse entry
  std::vector<double> entries_, full_rows_;  // C
  std::vector<char> full_fills_;             // which entries of the full rows can differ from zero
  std::vector<char> entry_fills_;            // the same for the sparse entries, as far as seen
  std::vector<int> columns_;                 // every column that differences must visit
  std::vector<int> gather_d_, gather_a_;     // entry of C of each entry of a block
  std::vector<double> moved_;                // d.dy at its columns, 0 elsewhere; where B exists
  std::vector<char> held_;                   // of each column
  std::vector<double> id_;                   // empty: none algebraic
  // Entries, zero so far, that would change the blocks: of the sparse rows and of the full ones.
  std::vector<std::size_t> watched_entries_, watched_full_;
  std::vector<int> mixed_;     // as in RowBlocks
  std::vector<char> without_;  // of each row
  LookAgain look_;
  bool outgrown_ = false;
  bool structured_ = false;
};

}  // namespace tether::ida_projection
