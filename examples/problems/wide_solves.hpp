// Tether: starts of mechanisms, solved in long double. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::problems {

/// a (n) and lam (m) with M a + sign G' lam = f and G a = -gamma, from double values; M is n x n,
/// G is m x n, both row by row.
void solve_motion_wide(int n, int m, const double* M, const double* G, double sign, const double* f,
                       const double* gamma, double* a, double* lam);

/// x (n) minus the least step with G step = r (m).
void take_least_step_wide(int n, int m, const double* G, const double* r, double* x);

}  // namespace tether::problems
