// Tether: a falling chain of many links, with sparse factors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// N >= 2 rods (0.1 m, 0.1 kg) in a row from a pin at the origin, released at rest along the x
/// axis, gravity 9.81, form "index 1" of pinned_rods.hpp: 8 N unknowns, 4 N + 1 rows, sparse
/// Jacobian for KLU, rows as a `SparseJacobian`. Energy stays 0; the tip falls freely at
/// first. Reference from absolute angles with the pins' forces from a block-tridiagonal system,
/// long double, up to N = 128; unknown above.
Problem link_chain(int N, double t_end);

}  // namespace tether::problems
