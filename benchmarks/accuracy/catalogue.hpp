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

/// Every case; a new problem is a file in examples/problems and an entry here.
std::vector<Case> catalogue();

/// The fourteen problems of differential-algebraic equations that SciMLBenchmarks runs, mostly out
/// of the test set for IVP solvers: first the form in which IDA is given it there, then others.
std::vector<Case> dae_set();

/// Those whose name contains one of `only` (all when it is empty) and none of `skip`; "_" may stand
/// for a blank. std::invalid_argument when a name of `only` fits no case.
std::vector<Case> selected(std::vector<Case> cases, const std::vector<std::string>& only,
                           const std::vector<std::string>& skip = {});

}  // namespace tether::bench
