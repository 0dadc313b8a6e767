// Tether: Siconos' solvers on a contact problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <tether/contact/problem.hpp>
#include <vector>

namespace tether::contact {

struct SiconosRun {
  std::string solver;
  bool finished = false;  // the solver returned within the time limit
  int info = -1, iterations = 0;
  double milliseconds = 0;  // CPU, median
  double error = -1;        // fc3d_compute_error's
  Eigen::VectorXd impulses;
};

// One thread for everybody: OpenBLAS reads its setting when it is loaded, so a program without it
// starts anew. Call it first in main.
void use_one_thread(char** argv);

bool has_siconos();
// Solvers that the comparison covers.
std::vector<std::string> siconos_solvers();
// Dense storage is the faster one for small problems in some of them.
bool siconos_is_tried_dense(const std::string& solver, int contacts);
// Cold solve of the problem in its native block or dense storage, in a process of its own that may
// take time_limit seconds.
SiconosRun run_siconos(const std::string& solver, const Problem& problem, bool dense,
                       double tolerance, double time_limit);

}  // namespace tether::contact
