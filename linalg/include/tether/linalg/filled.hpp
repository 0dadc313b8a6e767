// Tether: the entries of a row that are not zero. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>

namespace tether::linalg {

/// visit(j, c[j]) for the entries j of c[0 .. n-1] that are not zero, ascending: four zeros in a
/// row are passed at once.
template <class Visit>
void visit_filled(const double* c, int n, Visit visit) {
  int j = 0;
  for (; j + 4 <= n; j += 4) {
    std::uint64_t bits[4];
    std::memcpy(bits, c + j, sizeof bits);
    if (((bits[0] | bits[1] | bits[2] | bits[3]) << 1) == 0) continue;  // but for the sign
    for (int k = j; k < j + 4; ++k)
      if (c[k] != 0.0) visit(k, c[k]);
  }
  for (; j < n; ++j)
    if (c[j] != 0.0) visit(j, c[j]);
}

}  // namespace tether::linalg
