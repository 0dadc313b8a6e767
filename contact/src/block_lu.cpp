// Tether: sparse LU with 3x3 blocks. SPDX-License-Identifier: BSD-3-Clause
#include "block_lu.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

namespace tether::contact::detail {
namespace {

typedef double v4 __attribute__((vector_size(32)));

TETHER_INLINE void multiply(const double* A, const double* B, double* C) {
  const v4* a = reinterpret_cast<const v4*>(A);
  v4* c = reinterpret_cast<v4*>(C);
  for (int j = 0; j < 3; ++j)
    c[j] = a[0] * B[4 * j] + a[1] * B[4 * j + 1] + a[2] * B[4 * j + 2];
}

TETHER_INLINE void subtract_product(const double* A, const double* B, double* C) {
  const v4* a = reinterpret_cast<const v4*>(A);
  v4* c = reinterpret_cast<v4*>(C);
  for (int j = 0; j < 3; ++j)
    c[j] -= a[0] * B[4 * j] + a[1] * B[4 * j + 1] + a[2] * B[4 * j + 2];
}

TETHER_INLINE void subtract_apply(const double* A, const double* x, double* y) {
  const v4* a = reinterpret_cast<const v4*>(A);
  *reinterpret_cast<v4*>(y) -= a[0] * x[0] + a[1] * x[1] + a[2] * x[2];
}

bool invert(const double* A, double* X) {
  // Gauss-Jordan with partial pivoting: pivots are small for ill-conditioned contacts.
  double m[3][6];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      m[r][c] = A[4 * c + r];
      m[r][3 + c] = r == c ? 1 : 0;
    }
  for (int k = 0; k < 3; ++k) {
    int p = k;
    for (int r = k + 1; r < 3; ++r)
      if (std::abs(m[r][k]) > std::abs(m[p][k])) p = r;
    if (!(std::abs(m[p][k]) > 0) || !std::isfinite(m[p][k])) return false;
    if (p != k) std::swap(m[p], m[k]);
    const double inv = 1 / m[k][k];
    for (int c = 0; c < 6; ++c) m[k][c] *= inv;
    for (int r = 0; r < 3; ++r) {
      if (r == k) continue;
      const double f = m[r][k];
      for (int c = 0; c < 6; ++c) m[r][c] -= f * m[k][c];
    }
  }
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) X[4 * c + r] = m[r][3 + c];
    X[4 * c + 3] = 0;
  }
  return true;
}

struct Rows {
  const int* lower;
  int lower_count;
  const int* upper_start;
  const int* upper;
  const PackedBlock* U;
  const PackedBlock* inverse;
  PackedBlock* L;
  PackedBlock* work;
};

// Row elimination: work -= sum_k (work_k D_k^-1) U_k
TETHER_CLONES void eliminate(const Rows& s) {
  for (int m = 0; m < s.lower_count; ++m) {
    const int k = s.lower[m];
    alignas(32) double l[12];
    multiply(s.work[k].column, s.inverse[k].column, l);
    for (int c = 0; c < 12; ++c) s.L[m].column[c] = l[c];
    for (int p = s.upper_start[k]; p < s.upper_start[k + 1]; ++p)
      subtract_product(l, s.U[p].column, s.work[s.upper[p]].column);
  }
}

TETHER_CLONES void substitute(int n, const int* lower_start, const int* lower,
                              const PackedBlock* L, const int* upper_start, const int* upper,
                              const PackedBlock* U, const PackedBlock* inverse, PackedVector* y) {
  for (int r = 0; r < n; ++r)
    for (int m = lower_start[r]; m < lower_start[r + 1]; ++m)
      subtract_apply(L[m].column, y[lower[m]].v, y[r].v);
  for (int r = n; r-- > 0;) {
    for (int m = upper_start[r]; m < upper_start[r + 1]; ++m)
      subtract_apply(U[m].column, y[upper[m]].v, y[r].v);
    const double* d = inverse[r].column;
    const double v0 = y[r].v[0], v1 = y[r].v[1], v2 = y[r].v[2];
    for (int c = 0; c < 3; ++c) y[r].v[c] = d[c] * v0 + d[4 + c] * v1 + d[8 + c] * v2;
    y[r].v[3] = 0;
  }
}

}  // namespace

void BlockLu::order(const Problem& problem) {
  const int n = problem.contacts();
  const auto& start = problem.row_start();
  const auto& columns = problem.columns();
  full_order_.resize(at(n));
  for (int i = 0; i < n; ++i) full_order_[at(i)] = i;
  // A dense matrix has nothing to order.
  if (columns.size() < at(n) * at(n)) {
    Eigen::SparseMatrix<double, Eigen::ColMajor, int> pattern(n, n);
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(columns.size());
    for (int i = 0; i < n; ++i)
      for (int k = start[at(i)]; k < start[at(i + 1)]; ++k) entries.emplace_back(i, columns[at(k)], 1.0);
    pattern.setFromTriplets(entries.begin(), entries.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
    Eigen::AMDOrdering<int>()(pattern, permutation);
    for (int i = 0; i < n; ++i) full_order_[at(i)] = permutation.indices()[i];
  }
  analysed_ = false;
}

void BlockLu::analyse(const Problem& problem, const char* active) {
  const int n = problem.contacts();
  if (analysed_) {
    bool same = true;
    for (int i = 0; i < n && same; ++i) same = (active == nullptr || active[i]) == (active_[at(i)] != 0);
    if (same) return;
  }
  active_.resize(at(n));
  for (int i = 0; i < n; ++i) active_[at(i)] = active == nullptr || active[i] ? 1 : 0;
  contact_.clear();
  position_.assign(at(n), -1);
  for (int i : full_order_) {
    if (!active_[at(i)]) continue;
    position_[at(i)] = static_cast<int>(contact_.size());
    contact_.push_back(i);
  }
  n_ = static_cast<int>(contact_.size());

  // S_k = later neighbours of k and of the children of k in the elimination tree.
  const auto& start = problem.row_start();
  const auto& columns = problem.columns();
  std::vector<int> mark(at(n_), -1), first_child(at(n_), -1), sibling(at(n_), -1);
  upper_start_.assign(1, 0);
  upper_.clear();
  operations_ = 0;
  for (int k = 0; k < n_; ++k) {
    const std::size_t begin = upper_.size();
    mark[at(k)] = k;
    const int i = contact_[at(k)];
    for (int p = start[at(i)]; p < start[at(i + 1)]; ++p) {
      const int j = position_[at(columns[at(p)])];
      if (j > k && mark[at(j)] != k) {
        mark[at(j)] = k;
        upper_.push_back(j);
      }
    }
    for (int c = first_child[at(k)]; c >= 0; c = sibling[at(c)]) {
      for (int p = upper_start_[at(c)]; p < upper_start_[at(c + 1)]; ++p) {
        const int j = upper_[at(p)];
        if (j > k && mark[at(j)] != k) {
          mark[at(j)] = k;
          upper_.push_back(j);
        }
      }
    }
    std::sort(upper_.begin() + static_cast<std::ptrdiff_t>(begin), upper_.end());
    const double count = static_cast<double>(upper_.size() - begin);
    operations_ += count * count + 2 * count + 1;
    if (upper_.size() > begin) {
      const int parent = upper_[begin];
      sibling[at(k)] = first_child[at(parent)];
      first_child[at(parent)] = k;
    }
    upper_start_.push_back(static_cast<int>(upper_.size()));
  }
  lower_start_.assign(at(n_ + 1), 0);
  for (int j : upper_) ++lower_start_[at(j + 1)];
  for (int k = 0; k < n_; ++k) lower_start_[at(k + 1)] += lower_start_[at(k)];
  lower_.resize(upper_.size());
  std::vector<int>& fill = mark;
  for (int k = 0; k < n_; ++k) fill[at(k)] = lower_start_[at(k)];
  for (int k = 0; k < n_; ++k)
    for (int p = upper_start_[at(k)]; p < upper_start_[at(k + 1)]; ++p)
      lower_[at(fill[at(upper_[at(p)])]++)] = k;
  U_.resize(upper_.size());
  L_.resize(upper_.size());
  inverse_.resize(at(n_));
  work_.assign(at(n_), PackedBlock());
  rhs_.resize(at(n_));
  analysed_ = true;
}

void BlockLu::add(int contact, const double* block) {
  double* w = work_[at(position_[at(contact)])].column;
  for (int c = 0; c < 12; ++c) w[c] += block[c];
}

bool BlockLu::end_row() {
  const int r = row_, first = lower_start_[at(r)];
  eliminate({lower_.data() + first, lower_start_[at(r + 1)] - first, upper_start_.data(),
             upper_.data(), U_.data(), inverse_.data(), L_.data() + first, work_.data()});
  const PackedBlock zero;
  for (int m = first; m < lower_start_[at(r + 1)]; ++m) work_[at(lower_[at(m)])] = zero;
  for (int p = upper_start_[at(r)]; p < upper_start_[at(r + 1)]; ++p) {
    U_[at(p)] = work_[at(upper_[at(p)])];
    work_[at(upper_[at(p)])] = zero;
  }
  const bool regular = invert(work_[at(r)].column, inverse_[at(r)].column);
  work_[at(r)] = zero;
  return regular;
}

void BlockLu::solve(PackedVector* x) {
  for (int r = 0; r < n_; ++r) rhs_[at(r)] = x[contact_[at(r)]];
  substitute(n_, lower_start_.data(), lower_.data(), L_.data(), upper_start_.data(), upper_.data(),
             U_.data(), inverse_.data(), rhs_.data());
  for (int r = 0; r < n_; ++r) x[contact_[at(r)]] = rhs_[at(r)];
}

}  // namespace tether::contact::detail
