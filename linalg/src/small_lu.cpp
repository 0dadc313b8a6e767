// Tether: LU factors of small dense matrices. SPDX-License-Identifier: BSD-3-Clause
//
// Compiled without contraction to fused multiply-adds: small_lu.hpp promises the bits.
#include <cmath>
#include <cstddef>
#include <tether/linalg/small_lu.hpp>
#include <tether/linalg/vector_code.hpp>
#include <utility>

namespace tether::linalg {

namespace {

int largest_entry(const double* column, int from, int n) {
  int largest = from;
  for (int i = from + 1; i < n; ++i)
    if (std::abs(column[i]) > std::abs(column[largest])) largest = i;
  return largest;
}

constexpr int kColumns = 4;

// z[from .. to) less these columns times `known`, the first one first.
TETHER_CLONES void take_columns(const double* __restrict first, int n, const double* known,
                                int from, int to, double* z) {
  const double k0 = known[0], k1 = known[1], k2 = known[2], k3 = known[3];
  const double* __restrict c1 = first + n;
  const double* __restrict c2 = c1 + n;
  const double* __restrict c3 = c2 + n;
  double* __restrict out = z;
  for (int i = from; i < to; ++i)
    out[i] = (((out[i] - first[i] * k0) - c1[i] * k1) - c2[i] * k2) - c3[i] * k3;
}

// z[0 .. to) less them, the last one first.
TETHER_CLONES void take_columns_backwards(const double* __restrict first, int n,
                                          const double* known, int to, double* z) {
  const double k0 = known[0], k1 = known[1], k2 = known[2], k3 = known[3];
  const double* __restrict c1 = first + n;
  const double* __restrict c2 = c1 + n;
  const double* __restrict c3 = c2 + n;
  double* __restrict out = z;
  for (int i = 0; i < to; ++i)
    out[i] = (((out[i] - c3[i] * k3) - c2[i] * k2) - c1[i] * k1) - first[i] * k0;
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

// L z = P b forwards, U x = z backwards, by columns.
//
// Four columns at a time: an element of z is loaded and stored once for four of them, and what is
// taken from it is taken in the order of the columns, as one by one. Elements begin at multiples
// of four in every pass: a load across two stores would wait for both.
void SmallLU::solve_any(const SmallLU& self, const double* a, const double* b, double* x) {
  const int n = self.n_, whole = n / kColumns * kColumns;
  alignas(32) double z[kLargest];
  for (int k = 0; k < n; ++k) z[k] = b[self.row_[k]];
  for (int k = 0; k < whole; k += kColumns) {
    const double* first = a + static_cast<std::ptrdiff_t>(k) * n;
    for (int j = 0; j < kColumns; ++j)
      for (int i = j + 1; i < kColumns; ++i) z[k + i] -= first[j * n + k + i] * z[k + j];
    take_columns(first, n, z + k, k + kColumns, n, z);
  }
  for (int k = whole; k < n; ++k)
    for (int i = k + 1; i < n; ++i) z[i] -= a[k * n + i] * z[k];
  for (int k = n - 1; k >= whole; --k) {
    const double* column = a + static_cast<std::ptrdiff_t>(k) * n;
    const double known = z[k] /= column[k];
    for (int i = 0; i < k; ++i) z[i] -= column[i] * known;
  }
  for (int k = whole - kColumns; k >= 0; k -= kColumns) {
    const double* first = a + static_cast<std::ptrdiff_t>(k) * n;
    for (int j = kColumns - 1; j >= 0; --j) {
      z[k + j] /= first[j * n + k + j];
      for (int i = 0; i < j; ++i) z[k + i] -= first[j * n + k + i] * z[k + j];
    }
    take_columns_backwards(first, n, z + k, k, z);
  }
  for (int k = 0; k < n; ++k) x[k] = z[k];
}

}  // namespace tether::linalg
