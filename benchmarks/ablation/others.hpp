// Tether: problems that no mechanism was made for. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>
#include <vector>

namespace tether::bench {

/// Outputs of an arm, a titration, a circular orbit, three bodies, a top in rotation matrices and a
/// Toda lattice; rows without a Jacobian. References are runs of plain IDA at 1e-12.
std::vector<problems::Problem> others();
/// Sixty masses on rods, with and without bending springs, in index 1 and 2. References are
/// projected runs in index 1 at 1e-8: plain IDA does not begin at such tolerances.
std::vector<problems::Problem> chains_of_rods();

}  // namespace tether::bench
