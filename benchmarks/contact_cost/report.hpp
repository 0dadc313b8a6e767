// Tether: parts of contact_cost. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "accuracy/page.hpp"

namespace tether::bench {

/// Results of one part, in every form.
struct Report {
  std::string text, csv, html;
  Json json = Json::array();                                  ///< of runs
  std::vector<std::pair<std::string, std::string>> pictures;  ///< file name, SVG
};

/// Every problem of a folder by ours and by Siconos' solvers.
struct SolverPlan {
  std::string folder;
  std::vector<double> tolerances;
  double limit = 1;  ///< processor seconds of one solve
  bool siconos = true;
};
Report solver_cost(const SolverPlan& plan);

/// Scenes of the stepping engine over a range of time steps; others are named and left out.
Report step_cost(const std::vector<std::string>& scenes);

}  // namespace tether::bench
