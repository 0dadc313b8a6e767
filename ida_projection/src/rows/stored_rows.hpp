// Tether: C with its pattern. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "constraints/evaluator.hpp"
#include "rows/row_levels.hpp"

namespace tether::ida_projection {

/// The m rows of C on n unknowns: rows with a sparse pattern, and full rows of n entries. For full
/// rows it records which entries were ever seen to differ from zero.
class StoredRows {
 public:
  /// `sparse`: sets with a SparseJacobian keep their pattern; otherwise every row is full.
  StoredRows(const Evaluator& evaluator, int n, bool sparse);

  int rows() const { return static_cast<int>(rows_.size()); }
  int unknowns() const { return n_; }
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
    for (int e = 0; e < at.count; ++e)
      if (!at.full)
        f(columns_[static_cast<std::size_t>(at.begin + e)], c[e]);
      else if (c[e] != 0.0)
        f(e, c[e]);
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
  void notice(int i, int j) { seen_[static_cast<std::size_t>(row(i).begin + j)] = 1; }
  void forget_seen() { seen_.assign(values_.size(), 0); }
  void notice_all();
  /// Records which of these entries are not zero. Returns whether any is, or one that was recorded
  /// as constant has changed.
  bool notice(const std::vector<std::size_t>& entries);

  /// C at y; differences visit `columns`. g: null, or receives the values, too.
  Status evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                  const std::vector<int>& columns, double* g);

  /// The columns of these rows that can differ from zero.
  RowPattern pattern(const std::vector<int>& of_rows) const;

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
  std::vector<char> seen_;      // not to be zero, or not to be constant
};

}  // namespace tether::ida_projection
