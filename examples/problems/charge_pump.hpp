// Tether: charge pump of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// Two capacitors and a MOS transistor on a pulsed voltage, t in [0, 1.2e-6] s; index 2 by the
/// current of the source. Unknowns: charges of gate, source capacitor, source, drain capacitor,
/// drain; three voltages; the current. Absolute tolerances count charges in pC and the current in
/// mA.
///
/// Rows: "charges" (5) and "source" (1), which are equations of F, and "kept" (2): the charges of
/// source and drain with their capacitors. Together they fix charges and voltages at every time.
/// The voltage has kinks, at which the current jumps; the end is one of them.
Problem charge_pump();

}  // namespace tether::problems
