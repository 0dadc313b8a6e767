// Tether: from which sizes smooth scenes are solved by entries. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

namespace tether::scene::smooth {

/// Rows of joints, or bodies, each with a norm to keep: below, dense factors cost less.
constexpr int kManyRows = 48;
inline bool by_entries(int rows, int bodies) { return rows >= kManyRows || bodies >= kManyRows; }
/// Unknowns of IDA from which KLU is faster than the dense solver.
constexpr int kManyUnknowns = 80;

}  // namespace tether::scene::smooth
