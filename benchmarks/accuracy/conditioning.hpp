// Tether: how much a problem multiplies errors by itself. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "catalogue.hpp"

namespace tether::bench {

/// Largest |change of y(t_end)| / |change of the start| over a few small changes along the
/// constraints, relative to 1 + |y|, over all unknowns
/// at the start and the compared ones at the end: integrated in a form that is an ordinary
/// differential equation. NaN where the case has none or the runs fail. An error of some tolerances
/// in each step may grow by this factor until the end.
double amplification(const Case& which);

}  // namespace tether::bench
