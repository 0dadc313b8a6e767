// Tether: LU factors of small dense matrices. SPDX-License-Identifier: BSD-3-Clause
//
// Compiled without contraction to fused multiply-adds: small_lu.hpp promises the bits.
#include <cmath>
#include <cstddef>
#include <tether/linalg/small_lu.hpp>
#include <utility>

namespace tether::linalg {

namespace {

int largest_entry(const double* column, int from, int n) {
  int largest = from;
  for (int i = from + 1; i < n; ++i)
    if (std::abs(column[i]) > std::abs(column[largest])) largest = i;
  return largest;
}

}  // namespace

int SmallLU::factor(double* a, int n) {
  n_ = n;
  solve_ = solve_for(n);
  for (int k = 0; k < n; ++k) row_[k] = k;
  const auto column = [a, n](int j) { return a + static_cast<std::ptrdiff_t>(j) * n; };
  for (int k = 0; k < n; ++k) {
    double* pivots = column(k);
    const int l = largest_entry(pivots, k, n);
    if (pivots[l] == 0.0) return k + 1;
    if (l != k) {
      for (int j = 0; j < n; ++j) std::swap(column(j)[k], column(j)[l]);
      std::swap(row_[k], row_[l]);
    }
    const double inverse = 1.0 / pivots[k];
    for (int i = k + 1; i < n; ++i) pivots[i] *= inverse;
    for (int j = k + 1; j < n; ++j) {
      double* changed = column(j);
      const double share = changed[k];
      if (share == 0.0) continue;  // and 0 * infinity would be NaN
      for (int i = k + 1; i < n; ++i) changed[i] -= share * pivots[i];
    }
  }
  return 0;
}

// L z = P b forwards, U x = z backwards, by columns. Pairs of z begin at even indices in every
// column: a load across two stores would wait for both.
void SmallLU::solve_any(const SmallLU& self, const double* a, const double* b, double* x) {
  const int n = self.n_;
  alignas(16) double z[kLargest];
  for (int k = 0; k < n; ++k) z[k] = b[self.row_[k]];
  const double* column = a;
  for (int k = 0; k < n - 1; ++k, column += n) {
    const double known = z[k];
    int i = k + 1;
    if (i % 2) z[i] -= column[i] * known, ++i;
    for (; i < n; ++i) z[i] -= column[i] * known;
  }
  for (int k = n - 1; k >= 0; --k, column -= n) {
    const double known = z[k] /= column[k];
    for (int i = 0; i < k; ++i) z[i] -= column[i] * known;
  }
  for (int k = 0; k < n; ++k) x[k] = z[k];
}

}  // namespace tether::linalg
