// Tether: a few rows that are known to be independent, and A A^T = L diag(d) L^T of them.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::linalg::small {

/// Places of the entries, C(i, j) = wide[rows[i] * width + columns[j]], and the metric D.
struct Gathered {
  const double* wide;
  int width;
  const int *rows, *columns;
  const double* D;
};

/// A = C D of up to 16 rows in a given order, at most 32 columns. Column j of A and column k of L
/// are stored one after the other, each with the rows side by side: operations on a column take
/// four rows at once and need no sum over a vector, and no entry of C is read together with its
/// neighbour, which would wait for both when the caller has just written them.
struct KeptRows {
  static constexpr int kRows = 16, kColumns = 32;
  alignas(32) double A[kColumns * kRows];  // A(k, j) at [j * stride + k]
  alignas(32) double L[kRows * kRows];     // L(i, k), i > k, at [k * stride + i]
  double inverse[kRows];                   // 1 / d_k
  double square[kRows], ratio[kRows];      // of factor()

  /// Rows take `stride(m)` places in a column.
  static constexpr int stride(int m) { return (m + 3) / 4 * 4; }

  /// A A^T = L diag(d) L^T of the m rows order[0], order[1], ...; square[order[k]] receives
  /// |a_k|^2, ratio[k] the square of the part of row k that is independent of those before it,
  /// d_k / |a_k|^2. False: an entry is not finite, a length may overflow, or a ratio is below
  /// `least`.
  using Factor = bool (*)(KeptRows& s, const Gathered& from, const int* order, int m, int n,
                          double least);
  /// dy = D A^T (A A^T)^-1 g; g in the caller's order of rows.
  using Solve = void (*)(const KeptRows& s, const int* order, int n, const double* g,
                         const double* D, double* dy);
  Factor factor = nullptr;
  Solve solve = nullptr;
  /// The functions for m rows.
  void resize(int m) {
    factor = factor_for(m);
    solve = solve_for(m);
  }
  static Factor factor_for(int m);
  static Solve solve_for(int m);
};

}  // namespace tether::linalg::small
