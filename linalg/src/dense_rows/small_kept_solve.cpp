// Tether: solves with the factors of up to 16 kept rows, one function for each number of rows.
// SPDX-License-Identifier: BSD-3-Clause
//
// Compiled without vectors: the unknowns stay in registers, one in each, and an operation waits for
// the one before it only (see small_lu_sized.cpp).
#include <tether/linalg/vector_code.hpp>

#include "small_kept_rows.hpp"

namespace tether::linalg::small {

namespace {

template <int Rows>
TETHER_INLINE void solve(const KeptRows& s, const int* order, int n, const double* g,
                         const double* D, double* dy) {
  constexpr int kStride = KeptRows::stride(Rows);
  double z[Rows];
  for (int k = 0; k < Rows; ++k) z[k] = g[order[k]];
#pragma GCC unroll 16
  for (int k = 0; k < Rows - 1; ++k)
#pragma GCC unroll 16
    for (int i = k + 1; i < Rows; ++i) z[i] -= s.L[k * kStride + i] * z[k];
#pragma GCC unroll 16
  for (int k = 0; k < Rows; ++k) z[k] *= s.inverse[k];
#pragma GCC unroll 16
  for (int k = Rows - 1; k > 0; --k)
#pragma GCC unroll 16
    for (int i = 0; i < k; ++i) z[i] -= s.L[i * kStride + k] * z[k];
  const double* column = s.A;
  for (int j = 0; j < n; ++j, column += kStride) {
    double sum = column[Rows - 1] * z[Rows - 1];
#pragma GCC unroll 16
    for (int k = Rows - 2; k >= 0; --k) sum += column[k] * z[k];
    dy[j] = sum * D[j];
  }
}

#define TETHER_SOLVE(Rows)                                                                     \
  TETHER_CLONES void solve_##Rows(const KeptRows& s, const int* order, int n, const double* g, \
                                  const double* D, double* dy) {                               \
    solve<Rows>(s, order, n, g, D, dy);                                                        \
  }
TETHER_SOLVE(1)
TETHER_SOLVE(2)
TETHER_SOLVE(3)
TETHER_SOLVE(4)
TETHER_SOLVE(5)
TETHER_SOLVE(6)
TETHER_SOLVE(7)
TETHER_SOLVE(8)
TETHER_SOLVE(9)
TETHER_SOLVE(10)
TETHER_SOLVE(11)
TETHER_SOLVE(12)
TETHER_SOLVE(13)
TETHER_SOLVE(14)
TETHER_SOLVE(15)
TETHER_SOLVE(16)
#undef TETHER_SOLVE

}  // namespace

KeptRows::Solve KeptRows::solve_for(int m) {
  static constexpr Solve kSolves[] = {nullptr,  solve_1,  solve_2,  solve_3,  solve_4,  solve_5,
                                      solve_6,  solve_7,  solve_8,  solve_9,  solve_10, solve_11,
                                      solve_12, solve_13, solve_14, solve_15, solve_16};
  return m <= kRows ? kSolves[m] : nullptr;
}

}  // namespace tether::linalg::small
