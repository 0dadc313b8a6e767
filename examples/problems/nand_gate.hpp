// Tether: NAND gate of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// "index 0", C(V) V' = f(t, V) as published, and "index 1", Q' = f(t, V), Q = q(V).
std::vector<std::string> nand_gate_forms();

/// Three MOS transistors with two pulsed inputs, t in [0, 80]: 14 potentials, with charges after
/// them in "index 1". Rows: "charges" (14) in "index 1", equations of F; none in "index 0".
Problem nand_gate(const std::string& form);

}  // namespace tether::problems
