// Tether: what rows say where they do not succeed. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/projection.hpp>
#include <utility>
#include <vector>

namespace tether::ida_projection {

struct RowsReport {
  std::string text;
  std::vector<int> rows;  ///< that contradict each other
  bool fatal = false;     ///< a callback asked for the end of the run

  void contradicting(std::vector<int> found, const Constraints& constraints) {
    rows = std::move(found);
    text = "rows contradict each other:";
    for (const int i : rows) text += " " + std::to_string(i) + " (" + constraints.name(i) + ")";
  }
};

}  // namespace tether::ida_projection
