// Tether: Cholesky factors by the envelope. SPDX-License-Identifier: BSD-3-Clause
#include "envelope.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tether/linalg/vector_code.hpp>

namespace tether::linalg {

namespace {

constexpr int kFour = 4;
typedef double v4_of_envelope __attribute__((vector_size(32)));

TETHER_INLINE void load(v4_of_envelope& four, const double* from) {
  std::memcpy(&four, from, sizeof four);
}
TETHER_INLINE void store(double* to, const v4_of_envelope& four) {
  std::memcpy(to, &four, sizeof four);
}

// Subtracts from columns c[0 .. 3] of four rows the products of these rows with those of `above`,
// summed over the columns from `from` to `end`.
TETHER_INLINE void subtract_products(v4_of_envelope* c, const double* rows, const double* above,
                                     int from, int end) {
  v4_of_envelope c0 = c[0], c1 = c[1], c2 = c[2], c3 = c[3], entries;
  for (int l = kFour * from; l < kFour * end; l += kFour) {
    load(entries, rows + l);
    c0 -= above[l] * entries;
    c1 -= above[l + 1] * entries;
    c2 -= above[l + 2] * entries;
    c3 -= above[l + 3] * entries;
  }
  c[0] = c0;
  c[1] = c1;
  c[2] = c2;
  c[3] = c3;
}

// Factors the block on the diagonal of four rows. Leaves out rows whose diagonal entry is not above
// `least`; returns false if there is one and `least` is 0.
TETHER_INLINE bool factor_corner(double least, double* corner, double* diagonal, double* inverse) {
  for (int c = 0; c < kFour; ++c) {
    double* const column = corner + kFour * c;
    if (!(column[c] > least)) {
      if (!(least > 0.0)) return false;
      for (int r = c; r < kFour; ++r) column[r] = 0.0;
      diagonal[c] = inverse[c] = 0.0;
      continue;
    }
    diagonal[c] = std::sqrt(column[c]);
    inverse[c] = 1.0 / diagonal[c];
    for (int r = c + 1; r < kFour; ++r) column[r] *= inverse[c];
    for (int next = c + 1; next < kFour; ++next)
      for (int r = next; r < kFour; ++r) corner[kFour * next + r] -= column[r] * column[next];
  }
  return true;
}

// Factors four rows at a time, each time against four columns at a time.
TETHER_CLONES bool factor_fours(double least, int count, const int* firsts,
                                const std::ptrdiff_t* starts, double* L, double* diagonal,
                                double* inverse) {
  for (int k = 0; k < count; ++k) {
    double* const rows = L + starts[k];
    v4_of_envelope c[kFour];
    for (int j = firsts[k]; j <= k; ++j) {
      const double* const above = L + starts[j];
      double* const block = rows + kFour * kFour * j;
      for (int i = 0; i < kFour; ++i) load(c[i], block + kFour * i);
      subtract_products(c, rows, above, kFour * std::max(firsts[k], firsts[j]), kFour * j);
      if (j < k) {
        const double* const corner = above + kFour * kFour * j;
        for (int i = 0; i < kFour; ++i) {
          for (int before = 0; before < i; ++before) c[i] -= corner[kFour * before + i] * c[before];
          c[i] *= inverse[kFour * j + i];
        }
      }
      for (int i = 0; i < kFour; ++i) store(block + kFour * i, c[i]);
    }
    if (!factor_corner(least, rows + kFour * kFour * k, diagonal + kFour * k, inverse + kFour * k))
      return false;
  }
  return true;
}

TETHER_CLONES void solve_fours(int count, const int* firsts, const std::ptrdiff_t* starts,
                               const double* L, const double* inverse, double* x) {
  for (int k = 0; k < count; ++k) {
    const double* const rows = L + starts[k];
    v4_of_envelope left, entries;
    load(left, x + kFour * k);
    for (int l = kFour * firsts[k]; l < kFour * k; ++l) {
      load(entries, rows + kFour * l);
      left -= x[l] * entries;
    }
    store(x + kFour * k, left);
    double* const own = x + kFour * k;
    for (int c = 0; c < kFour; ++c) {
      own[c] *= inverse[kFour * k + c];
      const double* const column = rows + kFour * (kFour * k + c);
      for (int r = c + 1; r < kFour; ++r) own[r] -= column[r] * own[c];
    }
  }
  for (int k = count - 1; k >= 0; --k) {
    const double* const rows = L + starts[k];
    double* const own = x + kFour * k;
    for (int c = kFour - 1; c >= 0; --c) {
      const double* const column = rows + kFour * (kFour * k + c);
      for (int r = c + 1; r < kFour; ++r) own[c] -= column[r] * own[r];
      own[c] *= inverse[kFour * k + c];
    }
    v4_of_envelope share, entries;
    load(share, own);
    for (int l = kFour * firsts[k]; l < kFour * k; ++l) {
      load(entries, rows + kFour * l);
      entries *= share;
      x[l] -= (entries[0] + entries[2]) + (entries[1] + entries[3]);
    }
  }
}

}  // namespace

void Envelope::resize(int most) {
  const auto fours = static_cast<std::size_t>((most + kFour - 1) / kFour);
  firsts_.assign(fours, 0);
  starts_.assign(fours, 0);
  diagonal_.assign(kFour * fours, 0.0);
  inverse_.assign(kFour * fours, 0.0);
  L_.assign(kFour * kFour * fours * (fours + 1) / 2, 0.0);
  begin();
}

void Envelope::add_row(int first) {
  const auto k = static_cast<std::size_t>(size_ / kFour);
  int& least = firsts_[k];
  if (size_ % kFour == 0) least = size_ / kFour;
  least = std::min(least, first / kFour);
  ++size_;
}

void Envelope::plan() {
  std::ptrdiff_t entries = 0;
  for (int k = 0; k < count(); ++k) {
    const int first = firsts_[static_cast<std::size_t>(k)];
    starts_[static_cast<std::size_t>(k)] = entries - kFour * kFour * first;
    entries += kFour * kFour * (k + 1 - first);
  }
  entries_ = entries;
}

void Envelope::clear() {
  std::fill_n(L_.begin(), entries_, 0.0);
  for (int k = size_; k < kFour * count(); ++k)
    row(k)[kFour * k] = 1.0;  // rows that fill the last four
}

bool Envelope::factor(double least) {
  return factor_fours(least, count(), firsts_.data(), starts_.data(), L_.data(), diagonal_.data(),
                      inverse_.data());
}

void Envelope::solve(double* x) const {
  std::fill(x + size_, x + kFour * count(), 0.0);
  solve_fours(count(), firsts_.data(), starts_.data(), L_.data(), inverse_.data(), x);
}

}  // namespace tether::linalg
