// Tether: the tables of the main job. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "measure.hpp"

namespace pendulum {

/// How to read the tables.
void print_explanation();

/// One line for each run.
void print_runs(const Results& results);

/// CPU time that each form and set of constraints needs for a wanted error.
void print_costs(const std::vector<Results>& all);

}  // namespace pendulum
