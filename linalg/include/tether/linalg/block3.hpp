// Tether: 3x3 blocks and vectors of three, padded to a vector register. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// One 3x3 block as three columns of four doubles (the fourth is 0): a vector register each.
struct alignas(32) PackedBlock {
  double column[12] = {};  ///< entry (r, c) is column[4 c + r]
};
/// Three components and a zero.
struct alignas(32) PackedVector {
  double v[4] = {};  ///< v[3] = 0
};
/// A vector of blocks of three.
using PackedVectors = std::vector<PackedVector>;

/// Pattern of a square matrix of blocks, symmetric and with a full diagonal: block row i,
/// i = 0 .. size - 1, has the block columns columns[starts[i] .. starts[i + 1]).
struct BlockPattern {
  int size;            ///< block rows
  const int* starts;   ///< size + 1 entries
  const int* columns;  ///< of each block, ascending in a row
};

/// p.q over arrays of whole PackedVectors: n is a multiple of 4, storage is aligned to 32 bytes.
double dot(const double* p, const double* q, int n);
/// q += a p over arrays as in dot().
void axpy(double a, const double* p, double* q, int n);

}  // namespace tether::linalg
TETHER_EXPORT_END
