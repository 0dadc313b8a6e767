// Tether: the tables of Method::automatic. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/automatic.hpp"

namespace tether::contact::detail {

constexpr int kRoundOffSteps = 8;  // of interior points with long sums

/// Where a rotation stands.
struct Automatic::Rotation {
  bool first = true;     // round
  bool regular = true;   // no strongly coupled contact: the interior points' slip is differentiable
  bool dear = false;     // a factorisation costs many sweeps
  bool small = false;    // a run of interior points costs little of the work that is left
  bool coupled = false;  // the path from the convex problem has been followed
  double swept = 0;      // the error that the sweeps of this round have left
  double kappa = 1;      // factorisations that sweeps stay for
  double tenth = 0, halved = 0;  // errors at the last gain of ten and of two
  int rounds = 0;                // since the last rescue
  int paths = 0;                 // from sweeps, so far
  int bursts = 4, burst = 500, outers = 12;
  int patience = 0, most_patience = 3;
};

/// A row of a table: who has a turn when, with which budget (of its own unit). unsolved: the next
/// row has its turn; anything else ends the solve.
struct Automatic::Turn {
  Status (Automatic::*stage)(Search& search, Rotation& r, int budget);
  bool (*admitted)(const Search& search, const Rotation& r);
  int budget;
};

}  // namespace tether::contact::detail
