// Tether: sparse LU with 3x3 blocks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "system.hpp"

namespace tether::contact::detail {

// A diagonal block D as P D = L U: unit lower triangle, upper triangle with the reciprocals of its
// diagonal, row k of P D is row order[k] of D.
struct BlockPivot {
  double l10, l20, l21, u01, u02, u12, reciprocal[3];
  int order[3];
};

// Unsymmetric values on a symmetric pattern, pivots are the diagonal blocks in minimum-degree order.
// order() once for a problem, analyse() for each active set, then load() every block, factor().
class BlockLu {
 public:
  void order(const Problem& problem) { order(problem.row_start(), problem.columns()); }
  // Rows and columns with active != 0 (null: all). Does nothing if the set is the last one.
  void analyse(const Problem& problem, const char* active) {
    analyse(problem.row_start(), problem.columns(), active);
  }
  // The same for any pattern of blocks: symmetric, with its diagonal, columns ascending.
  void order(const std::vector<int>& start, const std::vector<int>& columns);
  void analyse(const std::vector<int>& start, const std::vector<int>& columns, const char* active);
  double operations() const { return operations_; }  // sum of |S_k|^2 over the pivots

  int size() const { return n_; }
  int contact(int row) const { return contact_[at(row)]; }   // elimination order -> contact
  int position(int contact) const { return position_[at(contact)]; }  // -1: not active

  // Rows are given one after the other: begin_row, add(column contact, 3 columns of 4), end_row.
  void begin_row(int row) { row_ = row; }
  void add(int contact, const double* block);
  bool end_row();  // eliminates; false: singular pivot

  // Solves in place; vector indexed by contact, inactive entries untouched.
  void solve(PackedVector* x);

 private:
  int n_ = 0, row_ = 0;
  double operations_ = 0;
  bool analysed_ = false;
  std::vector<int> full_order_;
  std::vector<char> active_;
  std::vector<int> contact_, position_;
  std::vector<int> upper_start_, upper_, lower_start_, lower_;
  std::vector<PackedBlock> U_, L_, work_;
  std::vector<BlockPivot> pivot_;
  Packed rhs_;
};

}  // namespace tether::contact::detail
