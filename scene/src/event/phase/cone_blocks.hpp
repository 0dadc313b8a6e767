// Tether: frictional problems of the event engine as those of the contact library.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/cones.hpp>
#include <tether/contact/solver.hpp>
#include <vector>

#include "shared_forces.hpp"

namespace tether::scene::event {

/// Answer of a frictional problem w = A x - b.
struct FrictionAnswer {
  bool solved = false;
  VectorXd x, w;
  std::vector<contact::Regime> regimes;
  double error = 0;
};

/// Solves w = A x - b for blocks (normal, tangents): friction cones, and where there are moments
/// the cones of rolling and torsional friction that these make with the contacts which hold them.
class ConeBlocks {
 public:
  ConeBlocks(const contact::Options& options, const Holders& holders)
      : contacts_(options), cones_(options), holders_(holders) {}
  FrictionAnswer solve(const MatrixXd& A, const VectorXd& b, const VectorXd& mu);

 private:
  FrictionAnswer solve_with_moments(const MatrixXd& A, const VectorXd& b, const VectorXd& mu);

  contact::Solver contacts_;
  contact::ConeSolver cones_;
  Holders holders_;
};

}  // namespace tether::scene::event
