// One way to solve a packing. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact.hpp>

#include "packing.hpp"

namespace tether::contact {

inline BodySolution run(const random::Packing& p, Law law, int threads, double tolerance = 1e-10) {
  BodyOptions o;
  o.law = law;
  o.tolerance = tolerance;
  o.max_sweeps = 20000;
  o.threads = threads;
  return BodySolver(o).solve(p.bodies, p.contacts);
}

}  // namespace tether::contact
