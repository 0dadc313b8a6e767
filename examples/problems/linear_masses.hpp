// Tether: two damped masses on a rigid link, linear. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// All forms of mechanism.hpp; "index 3" is the published one.
std::vector<std::string> linear_masses_forms();

/// Two masses of 100 that a rigid link keeps together, springs, dampers and a force that drops from
/// 10 to 0.06 at t = 0.1; t in [0, 20]. The linear system of the set of the Verivital laboratory
/// (DAEV). Rows: "position", "velocity", "acceleration", one each. The reference is exact.
Problem linear_masses(const std::string& form);

}  // namespace tether::problems
