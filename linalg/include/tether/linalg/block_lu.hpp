// Tether: sparse LU with 3x3 blocks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/linalg/block3.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// A 3x3 diagonal block D as P D = L U.
struct BlockPivot {
  double l10, l20, l21;  ///< below the unit diagonal of L
  double u01, u02, u12;  ///< above the diagonal of U
  double reciprocal[3];  ///< 1 / U_kk
  int order[3];          ///< row k of P D is row order[k] of D
};

/// L U of 3x3 blocks: unsymmetric values on a symmetric pattern. Pivots are the diagonal blocks in
/// approximate minimum-degree order (elimination.hpp). order() once for a pattern, analyse() for
/// each set of active rows. Then every row: begin_row, add for each of its blocks, end_row.
class BlockLu {
 public:
  /// Chooses the elimination order of a pattern. Allocates.
  void order(const BlockPattern& pattern);
  /// Rows and columns with active != 0 (null: all). Does nothing if the set is the last one.
  void analyse(const BlockPattern& pattern, const char* active);
  double operations() const { return operations_; }  ///< sum of |S_k|^2 over the pivots

  int size() const { return n_; }                               ///< active block rows
  int block_row(int row) const { return block_row_[at(row)]; }  ///< elimination order -> block row
  int position(int block_row) const { return position_[at(block_row)]; }  ///< -1: not active

  /// Rows one after the other, in elimination order; `block` has 3 columns of 4.
  void begin_row(int row) { row_ = row; }
  /// Adds a block to the row begun, in an active block column.
  void add(int block_column, const double* block);
  bool end_row();  ///< eliminates; false: singular pivot

  /// -1 or 1, after the last row.
  int determinant_sign() const;

  /// Solves in place; vector indexed by block row, inactive entries untouched.
  void solve(PackedVector* x);
  /// The same with the transposed matrix.
  void solve_transposed(PackedVector* x);

 private:
  int n_ = 0, row_ = 0;
  double operations_ = 0;
  bool analysed_ = false;
  std::vector<int> full_order_;
  std::vector<char> active_;
  std::vector<int> block_row_, position_;
  std::vector<int> upper_start_, upper_, lower_start_, lower_;
  std::vector<PackedBlock> U_, L_, work_;
  std::vector<BlockPivot> pivot_;
  PackedVectors rhs_;
};

/// BlockLu::operations() of a pattern, without the storage of its factors.
double elimination_operations(const BlockPattern& pattern);

}  // namespace tether::linalg
TETHER_EXPORT_END
