// Tether: the table of kernels for short rows. SPDX-License-Identifier: BSD-3-Clause
#include "small_orthogonal.hpp"

namespace tether::linalg::small {

namespace {

template <int Stride>
constexpr Kernel make_kernel() {
  return {Stride, form_rows<Stride>, gather_rows<Stride>, factor<Stride>, combine<Stride>};
}

constexpr Kernel kKernels[] = {
    make_kernel<2>(),  make_kernel<4>(),  make_kernel<6>(),  make_kernel<8>(),
    make_kernel<10>(), make_kernel<12>(), make_kernel<14>(), make_kernel<16>(),
    make_kernel<20>(), make_kernel<24>(), make_kernel<28>(), make_kernel<32>(),
};

}  // namespace

bool rescale_row(Storage& s, double* a, int stride, int i) {
  const double largest = largest_entry(a, stride);
  if (!std::isfinite(largest)) return false;
  double& square = s.square[i];
  square = 0.0;
  // A row below the normal range has no direction worth following.
  const bool vanishes = largest <= std::numeric_limits<double>::min();
  if (!vanishes) s.scale[i] = 1.0 / largest;
  for (int j = 0; j < stride; ++j) {
    a[j] = vanishes ? 0.0 : a[j] * s.scale[i];
    square += a[j] * a[j];
  }
  return true;
}

const Kernel& kernel_for(int n) {
  for (const Kernel& kernel : kKernels)
    if (kernel.stride >= n) return kernel;
  return kKernels[std::size(kKernels) - 1];
}

}  // namespace tether::linalg::small
