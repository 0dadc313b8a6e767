// Tether: the problems of the comparison. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>
#include <string>
#include <vector>

namespace tether::bench {

/// One motion in all its forms.
struct Case {
  std::string name;  ///< "pendulum"; what --problem looks for
  std::string text;  ///< one line: what makes it hard
  std::vector<problems::Problem> forms;
};

/// Every case; a new problem is a file in benchmarks/problems and an entry here.
std::vector<Case> catalogue();

}  // namespace tether::bench
