// Tether: sparse LU with 3x3 blocks. SPDX-License-Identifier: BSD-3-Clause
#include <tether/linalg/block_lu.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tether/linalg/vector_code.hpp>
#include <utility>

#include "elimination.hpp"

namespace tether::linalg {
namespace {

typedef double v4 __attribute__((vector_size(32)));

TETHER_INLINE void subtract_product(const double* A, const double* B, double* C) {
  const v4* a = reinterpret_cast<const v4*>(A);
  v4* c = reinterpret_cast<v4*>(C);
  for (int j = 0; j < 3; ++j) c[j] -= a[0] * B[4 * j] + a[1] * B[4 * j + 1] + a[2] * B[4 * j + 2];
}

TETHER_INLINE void subtract_apply(const double* A, const double* x, double* y) {
  const v4* a = reinterpret_cast<const v4*>(A);
  *reinterpret_cast<v4*>(y) -= a[0] * x[0] + a[1] * x[1] + a[2] * x[2];
}

// Factors a block with partial pivoting; `order` lists its rows as pivots. Returns false if it is
// singular.
bool factor(const double* A, BlockPivot& pivot) {
  double m[3][3];
  for (int r = 0; r < 3; ++r) {
    pivot.order[r] = r;
    for (int c = 0; c < 3; ++c) m[r][c] = A[4 * c + r];
  }
  for (int k = 0; k < 3; ++k) {
    int p = k;
    for (int r = k + 1; r < 3; ++r)
      if (std::abs(m[r][k]) > std::abs(m[p][k])) p = r;
    if (!(std::abs(m[p][k]) > 0) || !std::isfinite(m[p][k])) return false;
    if (p != k) {
      std::swap(m[p], m[k]);
      std::swap(pivot.order[p], pivot.order[k]);
    }
    pivot.reciprocal[k] = 1 / m[k][k];
    for (int r = k + 1; r < 3; ++r) {
      m[r][k] *= pivot.reciprocal[k];
      for (int c = k + 1; c < 3; ++c) m[r][c] -= m[r][k] * m[k][c];
    }
  }
  pivot.l10 = m[1][0];
  pivot.l20 = m[2][0];
  pivot.l21 = m[2][1];
  pivot.u01 = m[0][1];
  pivot.u02 = m[0][2];
  pivot.u12 = m[1][2];
  return true;
}

// Computes X = B D^-1 by substitution. With a stored inverse, X D would differ from B by cond(D)
// times the rounding, which is as large as B itself for contacts near the edge of their cones.
TETHER_INLINE void divide(const double* B, const BlockPivot& d, double* X) {
  const v4* b = reinterpret_cast<const v4*>(B);
  v4* x = reinterpret_cast<v4*>(X);
  const v4 y0 = b[0] * d.reciprocal[0];
  const v4 y1 = (b[1] - y0 * d.u01) * d.reciprocal[1];
  const v4 z2 = (b[2] - y0 * d.u02 - y1 * d.u12) * d.reciprocal[2];
  const v4 z1 = y1 - z2 * d.l21;
  x[d.order[0]] = y0 - z1 * d.l10 - z2 * d.l20;
  x[d.order[1]] = z1;
  x[d.order[2]] = z2;
}

// Solves y <- D^-1 y.
TETHER_INLINE void solve_pivot(const BlockPivot& d, double* y) {
  const double f0 = y[d.order[0]];
  const double f1 = y[d.order[1]] - d.l10 * f0;
  const double f2 = y[d.order[2]] - d.l20 * f0 - d.l21 * f1;
  y[2] = f2 * d.reciprocal[2];
  y[1] = (f1 - d.u12 * y[2]) * d.reciprocal[1];
  y[0] = (f0 - d.u01 * y[1] - d.u02 * y[2]) * d.reciprocal[0];
  y[3] = 0;
}

// Solves y <- D^-T y.
TETHER_INLINE void solve_pivot_transposed(const BlockPivot& d, double* y) {
  const double f0 = y[0] * d.reciprocal[0];
  const double f1 = (y[1] - d.u01 * f0) * d.reciprocal[1];
  const double f2 = (y[2] - d.u02 * f0 - d.u12 * f1) * d.reciprocal[2];
  const double g1 = f1 - d.l21 * f2;
  const double g0 = f0 - d.l10 * g1 - d.l20 * f2;
  y[d.order[0]] = g0;
  y[d.order[1]] = g1;
  y[d.order[2]] = f2;
  y[3] = 0;
}

// Computes y <- y - A^T x.
TETHER_INLINE void subtract_transposed(const double* A, const double* x, double* y) {
  for (int c = 0; c < 3; ++c) y[c] -= A[4 * c] * x[0] + A[4 * c + 1] * x[1] + A[4 * c + 2] * x[2];
}

struct Rows {
  const int* lower;
  int lower_count;
  const int* upper_start;
  const int* upper;
  const PackedBlock* U;
  const BlockPivot* pivot;
  PackedBlock* L;
  PackedBlock* work;
};

// Eliminates a row: work <- work - sum_k (work_k D_k^-1) U_k.
TETHER_CLONES void eliminate(const Rows& s) {
  for (int m = 0; m < s.lower_count; ++m) {
    const int k = s.lower[m];
    alignas(32) double l[12];
    divide(s.work[k].column, s.pivot[k], l);
    for (int c = 0; c < 12; ++c) s.L[m].column[c] = l[c];
    for (int p = s.upper_start[k]; p < s.upper_start[k + 1]; ++p)
      subtract_product(l, s.U[p].column, s.work[s.upper[p]].column);
  }
}

TETHER_CLONES void substitute(int n, const int* lower_start, const int* lower, const PackedBlock* L,
                              const int* upper_start, const int* upper, const PackedBlock* U,
                              const BlockPivot* pivot, PackedVector* y) {
  for (int r = 0; r < n; ++r)
    for (int m = lower_start[r]; m < lower_start[r + 1]; ++m)
      subtract_apply(L[m].column, y[lower[m]].v, y[r].v);
  for (int r = n; r-- > 0;) {
    for (int m = upper_start[r]; m < upper_start[r + 1]; ++m)
      subtract_apply(U[m].column, y[upper[m]].v, y[r].v);
    solve_pivot(pivot[r], y[r].v);
  }
}

std::vector<int> elimination_order(const BlockPattern& pattern) {
  if (static_cast<double>(pattern.starts[pattern.size]) <
      static_cast<double>(pattern.size) * pattern.size)
    return minimum_degree_order(pattern);
  std::vector<int> order(at(pattern.size));  // full: nothing to order
  std::iota(order.begin(), order.end(), 0);
  return order;
}

// Returns the block operations of an elimination whose factor has columns with these `starts`.
double count_operations(const std::vector<int>& starts) {
  double operations = 0;
  for (std::size_t k = 0; k + 1 < starts.size(); ++k) {
    const double count = starts[k + 1] - starts[k];
    operations += count * count + 2 * count + 1;
  }
  return operations;
}

}  // namespace

double elimination_operations(const BlockPattern& pattern) {
  const std::vector<int> order = elimination_order(pattern);
  std::vector<int> position(at(pattern.size)), starts, rows;
  for (int k = 0; k < pattern.size; ++k) position[at(order[at(k)])] = k;
  find_fill(pattern, order, position, starts, rows);
  return count_operations(starts);
}

void BlockLu::order(const BlockPattern& pattern) {
  full_order_ = elimination_order(pattern);
  analysed_ = false;
}

void BlockLu::analyse(const BlockPattern& pattern, const char* active) {
  const int n = pattern.size;
  if (analysed_) {
    bool same = true;
    for (int i = 0; i < n && same; ++i)
      same = (active == nullptr || active[i]) == (active_[at(i)] != 0);
    if (same) return;
  }
  active_.resize(at(n));
  for (int i = 0; i < n; ++i) active_[at(i)] = active == nullptr || active[i] ? 1 : 0;
  block_row_.clear();
  position_.assign(at(n), -1);
  for (int i : full_order_) {
    if (!active_[at(i)]) continue;
    position_[at(i)] = static_cast<int>(block_row_.size());
    block_row_.push_back(i);
  }
  n_ = static_cast<int>(block_row_.size());
  find_fill(pattern, block_row_, position_, upper_start_, upper_);
  operations_ = count_operations(upper_start_);
  transpose(n_, upper_start_, upper_, lower_start_, lower_);
  U_.resize(upper_.size());
  L_.resize(upper_.size());
  pivot_.resize(at(n_));
  work_.assign(at(n_), PackedBlock());
  rhs_.resize(at(n_));
  analysed_ = true;
}

void BlockLu::add(int block_column, const double* block) {
  double* w = work_[at(position_[at(block_column)])].column;
  for (int c = 0; c < 12; ++c) w[c] += block[c];
}

bool BlockLu::end_row() {
  const int r = row_, first = lower_start_[at(r)];
  eliminate({lower_.data() + first, lower_start_[at(r + 1)] - first, upper_start_.data(),
             upper_.data(), U_.data(), pivot_.data(), L_.data() + first, work_.data()});
  const PackedBlock zero;
  for (int m = first; m < lower_start_[at(r + 1)]; ++m) work_[at(lower_[at(m)])] = zero;
  for (int p = upper_start_[at(r)]; p < upper_start_[at(r + 1)]; ++p) {
    U_[at(p)] = work_[at(upper_[at(p)])];
    work_[at(upper_[at(p)])] = zero;
  }
  const bool regular = factor(work_[at(r)].column, pivot_[at(r)]);
  work_[at(r)] = zero;
  return regular;
}

int BlockLu::determinant_sign() const {
  bool negative = false;
  for (int r = 0; r < n_; ++r) {
    const BlockPivot& d = pivot_[at(r)];
    for (double reciprocal : d.reciprocal) negative ^= reciprocal < 0;
    const bool even = (d.order[1] - d.order[0] + 3) % 3 == 1;  // (0 1 2), (1 2 0), (2 0 1)
    negative ^= !even;
  }
  return negative ? -1 : 1;
}

void BlockLu::solve(PackedVector* x) {
  for (int r = 0; r < n_; ++r) rhs_[at(r)] = x[block_row_[at(r)]];
  substitute(n_, lower_start_.data(), lower_.data(), L_.data(), upper_start_.data(), upper_.data(),
             U_.data(), pivot_.data(), rhs_.data());
  for (int r = 0; r < n_; ++r) x[block_row_[at(r)]] = rhs_[at(r)];
}

void BlockLu::solve_transposed(PackedVector* x) {
  for (int r = 0; r < n_; ++r) rhs_[at(r)] = x[block_row_[at(r)]];
  for (int r = 0; r < n_; ++r) {
    solve_pivot_transposed(pivot_[at(r)], rhs_[at(r)].v);
    for (int m = upper_start_[at(r)]; m < upper_start_[at(r + 1)]; ++m)
      subtract_transposed(U_[at(m)].column, rhs_[at(r)].v, rhs_[at(upper_[at(m)])].v);
  }
  for (int r = n_; r-- > 0;)
    for (int m = lower_start_[at(r)]; m < lower_start_[at(r + 1)]; ++m)
      subtract_transposed(L_[at(m)].column, rhs_[at(r)].v, rhs_[at(lower_[at(m)])].v);
  for (int r = 0; r < n_; ++r) x[block_row_[at(r)]] = rhs_[at(r)];
}

}  // namespace tether::linalg
