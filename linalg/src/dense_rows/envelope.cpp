// Tether: Cholesky factors by the envelope. SPDX-License-Identifier: BSD-3-Clause
#include "envelope.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tether/linalg/vector_code.hpp>

namespace tether::linalg {

namespace {

typedef double v4_of_envelope __attribute__((vector_size(32)));

TETHER_INLINE double dot(const double* a, const double* b, int n) {
  v4_of_envelope sum = {0.0, 0.0, 0.0, 0.0};
  int i = 0;
  for (; i + 4 <= n; i += 4) {
    v4_of_envelope x, y;
    std::memcpy(&x, a + i, sizeof x);
    std::memcpy(&y, b + i, sizeof y);
    sum += x * y;
  }
  double rest = 0.0;
  for (; i < n; ++i) rest += a[i] * b[i];
  return ((sum[0] + sum[2]) + (sum[1] + sum[3])) + rest;
}

TETHER_CLONES bool factor_rows(int size, const int* firsts, const std::ptrdiff_t* rows, double* L,
                               double* inverse) {
  for (int k = 0; k < size; ++k) {
    double* row = L + rows[k];
    const int first = firsts[k];
    for (int j = first; j < k; ++j) {
      const int from = first > firsts[j] ? first : firsts[j];
      row[j] = (row[j] - dot(row + from, L + rows[j] + from, j - from)) * inverse[j];
    }
    const double square = row[k] - dot(row + first, row + first, k - first);
    if (!(square > 0.0)) return false;
    row[k] = std::sqrt(square);
    inverse[k] = 1.0 / row[k];
  }
  return true;
}

TETHER_CLONES void solve_rows(int size, const int* firsts, const std::ptrdiff_t* rows,
                              const double* __restrict L, const double* __restrict inverse,
                              double* __restrict x) {
  for (int k = 0; k < size; ++k) {
    const int first = firsts[k];
    x[k] = (x[k] - dot(L + rows[k] + first, x + first, k - first)) * inverse[k];
  }
  for (int k = size - 1; k >= 0; --k) {
    const double share = x[k] *= inverse[k];
    const double* row = L + rows[k];
    for (int j = firsts[k]; j < k; ++j) x[j] -= share * row[j];
  }
}

}  // namespace

void Envelope::resize(int most) {
  const auto rows = static_cast<std::size_t>(most);
  firsts_.assign(rows, 0);
  rows_.assign(rows, 0);
  inverse_.assign(rows, 0.0);
  L_.assign(rows * (rows + 1) / 2, 0.0);
  begin();
}

void Envelope::add_row(int first) {
  if (size_ == 0) entries_ = 0;
  const auto k = static_cast<std::size_t>(size_);
  firsts_[k] = first;
  rows_[k] = entries_ - first;
  entries_ += ++size_ - first;
}

void Envelope::clear() { std::fill_n(L_.begin(), size_ == 0 ? 0 : entries_, 0.0); }

bool Envelope::factor() {
  return factor_rows(size_, firsts_.data(), rows_.data(), L_.data(), inverse_.data());
}

void Envelope::solve(double* x) const {
  solve_rows(size_, firsts_.data(), rows_.data(), L_.data(), inverse_.data(), x);
}

}  // namespace tether::linalg
