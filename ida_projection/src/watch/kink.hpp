// Tether: rows that have a kink on their set. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

namespace tether::ida_projection {

extern const char* const kKink;  ///< what to say of one

/// Is `given`, the entry of C in that row and column at y, the slope of g to one side only?
bool has_kink(const Constraints& constraints, int row, int column, double given, double t,
              std::vector<double> y);

/// The entry of C that check_jacobian finds wrong at y, with kKink where that is the reason; empty:
/// none, or g refuses a point nearby.
std::string wrong_entry(const Constraints& constraints, double t, const std::vector<double>& y);

/// Do slopes of the row to both sides differ, by much of the largest? 2 N + 1 evaluations of g.
bool has_kink(const Constraints& constraints, int row, double t, std::vector<double> y);

/// Those of the rows that seem to hold one side of their set only: g_i stays as it is to one side
/// along some direction, and moves to the other. Five evaluations of g for all of them.
std::vector<int> one_sided(const Constraints& constraints, const std::vector<int>& rows, double t,
                           const std::vector<double>& y);

}  // namespace tether::ida_projection
