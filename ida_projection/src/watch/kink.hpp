// Tether: rows that have a kink on their set. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

namespace tether::ida_projection {

extern const char* const kKink;  ///< text of a message about a kink

/// Whether `given`, the entry of C in that row and column at y, is the slope of g to one side only.
bool has_kink(const Constraints& constraints, int row, int column, double given, double t,
              std::vector<double> y);

/// The entry of C that check_jacobian finds wrong at y, with kKink where that is the reason; empty:
/// none, or g refuses a point nearby.
std::string wrong_entry(const Constraints& constraints, double t, const std::vector<double>& y);

/// Whether slopes of the row to both sides differ by a large part of the largest slope. Costs 2 N +
/// 1 evaluations of g.
bool has_kink(const Constraints& constraints, int row, double t, std::vector<double> y);

/// Those of the rows that seem to hold on one side of their set only: along some direction g_i is
/// constant to one side and changes to the other. Costs five evaluations of g for all rows.
std::vector<int> one_sided(const Constraints& constraints, const std::vector<int>& rows, double t,
                           const std::vector<double>& y);

}  // namespace tether::ida_projection
