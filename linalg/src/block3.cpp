// Tether: sums over packed vectors. SPDX-License-Identifier: BSD-3-Clause
#include <tether/linalg/block3.hpp>
#include <tether/linalg/vector_code.hpp>

namespace tether::linalg {
namespace {

typedef double v4 __attribute__((vector_size(32)));

TETHER_CLONES double dot_kernel(const double* p, const double* q, int n) {
  v4 sum0 = {0, 0, 0, 0}, sum1 = {0, 0, 0, 0};
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    sum0 += *reinterpret_cast<const v4*>(p + i) * *reinterpret_cast<const v4*>(q + i);
    sum1 += *reinterpret_cast<const v4*>(p + i + 4) * *reinterpret_cast<const v4*>(q + i + 4);
  }
  for (; i + 4 <= n; i += 4)
    sum0 += *reinterpret_cast<const v4*>(p + i) * *reinterpret_cast<const v4*>(q + i);
  sum0 += sum1;
  return (sum0[0] + sum0[1]) + (sum0[2] + sum0[3]);
}

TETHER_CLONES void axpy_kernel(double a, const double* p, double* q, int n) {
  for (int i = 0; i < n; i += 4)
    *reinterpret_cast<v4*>(q + i) += a * *reinterpret_cast<const v4*>(p + i);
}

}  // namespace

double dot(const double* p, const double* q, int n) { return dot_kernel(p, q, n); }
void axpy(double a, const double* p, double* q, int n) { axpy_kernel(a, p, q, n); }

}  // namespace tether::linalg
