// Tether: A A^T = L diag(d) L^T of a few rows, four rows at once. SPDX-License-Identifier:
// BSD-3-Clause
#include "small_kept_rows.hpp"

#include <cstddef>
#include <tether/linalg/vector_code.hpp>

namespace tether::linalg::small {

namespace {

typedef double v4 __attribute__((vector_size(32)));

constexpr double kSmallestSquare = 1e-280, kLargestSquare = 1e280;

// Gathers the columns of A = C D with the rows in their order. Lanes beyond m repeat the first row.
template <int Lanes>
TETHER_INLINE void gather(KeptRows& s, const Gathered& from, const int* order, int m, int n) {
  const double* c[4 * Lanes];
  for (int k = 0; k < 4 * Lanes; ++k)
    c[k] = from.wide + static_cast<std::ptrdiff_t>(from.rows[order[k < m ? k : 0]]) * from.width;
  v4* A = reinterpret_cast<v4*>(s.A);
  for (int j = 0; j < n; ++j, A += Lanes) {
    const int column = from.columns[j];
    for (int v = 0; v < Lanes; ++v) {
      const v4 four = {c[4 * v][column], c[4 * v + 1][column], c[4 * v + 2][column],
                       c[4 * v + 3][column]};
      A[v] = four * from.D[j];
    }
  }
}

// Computes columns 4 Block .. 4 Block + 3 of L and of U^T = L diag(d): column a of U^T is that of
// A A^T less the products of the columns before it. Rows above the block are skipped.
template <int Lanes, int Block>
TETHER_INLINE bool factor_block(KeptRows& s, double* U, const int* order, int m, int n,
                                double least) {
  constexpr int kStride = 4 * Lanes, kRest = Lanes - Block;
  for (int a = 4 * Block; a < m && a < 4 * Block + 4; ++a) {
    v4 sum[kRest];
    for (int v = 0; v < kRest; ++v) sum[v] = v4{0.0, 0.0, 0.0, 0.0};
    for (int j = 0; j < n; ++j) {
      const v4* column = reinterpret_cast<const v4*>(s.A + j * kStride) + Block;
      const double entry = s.A[j * kStride + a];
      for (int v = 0; v < kRest; ++v) sum[v] += column[v] * entry;
    }
    alignas(32) double diagonal[4];
    *reinterpret_cast<v4*>(diagonal) = sum[0];
    const double whole = diagonal[a - 4 * Block];
    for (int k = 0; k < a; ++k) {
      const v4* column = reinterpret_cast<const v4*>(s.L + k * kStride) + Block;
      const double entry = U[k * kStride + a];
      for (int v = 0; v < kRest; ++v) sum[v] -= column[v] * entry;
    }
    *reinterpret_cast<v4*>(diagonal) = sum[0];
    const double d = diagonal[a - 4 * Block];
    const double inverse = 1.0 / d;
    for (int v = 0; v < kRest; ++v) {
      reinterpret_cast<v4*>(U + a * kStride)[Block + v] = sum[v];
      reinterpret_cast<v4*>(s.L + a * kStride)[Block + v] = sum[v] * inverse;
    }
    s.inverse[a] = inverse;
    s.square[order[a]] = whole;
    s.ratio[a] = d / whole;
    // Written so that NaN fails, too.
    if (!(whole > kSmallestSquare && whole < kLargestSquare && d >= least * whole)) return false;
  }
  return true;
}

// The same for one row.
TETHER_INLINE bool factor_one(KeptRows& s, const Gathered& from, int n) {
  const double* c = from.wide + static_cast<std::ptrdiff_t>(from.rows[0]) * from.width;
  double square = 0.0;
  for (int j = 0; j < n; ++j) {
    const double a = c[from.columns[j]] * from.D[j];
    s.A[KeptRows::stride(1) * j] = a;
    square += a * a;
  }
  s.inverse[0] = 1.0 / square;
  s.square[0] = square;
  s.ratio[0] = 1.0;
  return square > kSmallestSquare && square < kLargestSquare;
}

// Factors up to four rows. A A^T is summed while the columns are gathered, and no entry of it or of
// L is loaded from memory just after it was stored.
template <int Rows>
TETHER_INLINE bool factor_few(KeptRows& s, const Gathered& from, const int* order, int n,
                              double least) {
  if constexpr (Rows == 1) return factor_one(s, from, n);
  const double* c[4];
  for (int k = 0; k < 4; ++k)
    c[k] = from.wide + static_cast<std::ptrdiff_t>(from.rows[order[k < Rows ? k : 0]]) * from.width;
  v4 U[Rows] = {}, L[Rows];  // U begins as A A^T
  v4* A = reinterpret_cast<v4*>(s.A);
  for (int j = 0; j < n; ++j) {
    const int column = from.columns[j];
    const v4 four = v4{c[0][column], c[1][column], c[2][column], c[3][column]} * from.D[j];
    A[j] = four;
#pragma GCC unroll 4
    for (int a = 0; a < Rows; ++a) U[a] += four * four[a];
  }
  bool good = true;
#pragma GCC unroll 4
  for (int a = 0; a < Rows; ++a) {
    const double whole = U[a][a];
#pragma GCC unroll 4
    for (int k = 0; k < a; ++k) U[a] -= L[k] * U[k][a];
    const double d = U[a][a], inverse = 1.0 / d;
    L[a] = U[a] * inverse;
    reinterpret_cast<v4*>(s.L)[a] = L[a];
    s.inverse[a] = inverse;
    s.square[order[a]] = whole;
    s.ratio[a] = d / whole;
    // Written so that NaN fails, too.
    good &= whole > kSmallestSquare && whole < kLargestSquare && d >= least * whole;
  }
  return good;
}

template <int Lanes>
TETHER_INLINE bool factor(KeptRows& s, const Gathered& from, const int* order, int m, int n,
                          double least) {
  alignas(32) double U[4 * Lanes * 4 * Lanes];
  gather<Lanes>(s, from, order, m, n);
  bool good = factor_block<Lanes, 0>(s, U, order, m, n, least);
  if constexpr (Lanes > 1) good = good && factor_block<Lanes, 1>(s, U, order, m, n, least);
  if constexpr (Lanes > 2) good = good && factor_block<Lanes, 2>(s, U, order, m, n, least);
  if constexpr (Lanes > 3) good = good && factor_block<Lanes, 3>(s, U, order, m, n, least);
  return good;
}

#define TETHER_FACTOR(Lanes)                                                                    \
  TETHER_CLONES bool factor_##Lanes(KeptRows& s, const Gathered& from, const int* order, int m, \
                                    int n, double least) {                                      \
    return factor<Lanes>(s, from, order, m, n, least);                                          \
  }
TETHER_FACTOR(2)
TETHER_FACTOR(3)
TETHER_FACTOR(4)
#undef TETHER_FACTOR

#define TETHER_FACTOR_FEW(Rows)                                                                  \
  TETHER_CLONES bool factor_few_##Rows(KeptRows& s, const Gathered& from, const int* order, int, \
                                       int n, double least) {                                    \
    return factor_few<Rows>(s, from, order, n, least);                                           \
  }
TETHER_FACTOR_FEW(1)
TETHER_FACTOR_FEW(2)
TETHER_FACTOR_FEW(3)
TETHER_FACTOR_FEW(4)
#undef TETHER_FACTOR_FEW

}  // namespace

KeptRows::Factor KeptRows::factor_for(int m) {
  static constexpr Factor kFew[] = {factor_few_1, factor_few_2, factor_few_3, factor_few_4};
  static constexpr Factor kFactors[] = {factor_2, factor_3, factor_4};
  if (m <= 0 || m > kRows) return nullptr;
  return m <= 4 ? kFew[m - 1] : kFactors[stride(m) / 4 - 2];
}

}  // namespace tether::linalg::small
