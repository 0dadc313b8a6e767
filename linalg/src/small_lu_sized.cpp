// Tether: solves with LU factors of up to 16 rows, one function for each size.
// SPDX-License-Identifier: BSD-3-Clause
//
// Compiled without contraction to fused multiply-adds and without vectors, see below.
#include <tether/linalg/small_lu.hpp>

namespace tether::linalg {

// L z = P b forwards, U x = z backwards, by columns: in this order an operation waits for the one
// before it only. Sizes of their own keep z in registers, one element in each. (In pairs that begin
// at every k, each load would wait for two stores.)
template <int Size>
void SmallLU::solve_sized(const SmallLU& self, const double* a, const double* b, double* x) {
  double z[Size];
  for (int k = 0; k < Size; ++k) z[k] = b[self.row_[k]];
#pragma GCC unroll 16
  for (int k = 0; k < Size - 1; ++k)
#pragma GCC unroll 16
    for (int i = k + 1; i < Size; ++i) z[i] -= a[k * Size + i] * z[k];
#pragma GCC unroll 16
  for (int k = Size - 1; k >= 0; --k) {
    z[k] /= a[k * Size + k];
#pragma GCC unroll 16
    for (int i = 0; i < k; ++i) z[i] -= a[k * Size + i] * z[k];
  }
  for (int k = 0; k < Size; ++k) x[k] = z[k];
}

SmallLU::Solve SmallLU::solve_for(int n) {
  constexpr int kSized = 16;
  static constexpr Solve solves[kSized + 1] = {
      solve_any,       solve_sized<1>,  solve_sized<2>,  solve_sized<3>,  solve_sized<4>,
      solve_sized<5>,  solve_sized<6>,  solve_sized<7>,  solve_sized<8>,  solve_sized<9>,
      solve_sized<10>, solve_sized<11>, solve_sized<12>, solve_sized<13>, solve_sized<14>,
      solve_sized<15>, solve_sized<16>};
  return solves[n <= kSized ? n : 0];
}

}  // namespace tether::linalg
