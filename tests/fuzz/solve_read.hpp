// Tether: what must hold of a contact problem that a reader accepted. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdlib>
#include <stdexcept>
#include <tether/contact.hpp>

namespace tether::fuzz {

/// Solved in bounded work under each law; an answer that says "solved" is finite. Ends the program
/// where that does not hold.
inline void solve_read(const contact::Problem& problem) {
  if (problem.contacts() > 40) return;
  for (const contact::Law law : {contact::Law::coulomb, contact::Law::maximum_dissipation}) {
    contact::Options options;
    options.law = law;
    options.max_work = 1e5;
    try {
      const contact::Solution solution = contact::Solver(options).solve(problem);
      if (solution.status == contact::Status::solved && !solution.impulses.allFinite())
        std::abort();
    } catch (const std::invalid_argument&) {  // a block that is not positive, say
    }
  }
}

inline void solve_read(const contact::ConeProblem& problem) {
  if (problem.rows() > 120) return;
  contact::Options options;
  options.law = contact::Law::coulomb;
  options.max_work = 1e5;
  try {
    const contact::ConeSolution solution = contact::ConeSolver(options).solve(problem);
    if (solution.status == contact::Status::solved && !solution.impulses.allFinite()) std::abort();
  } catch (const std::invalid_argument&) {  // a block that is not positive, say
  }
}

}  // namespace tether::fuzz
