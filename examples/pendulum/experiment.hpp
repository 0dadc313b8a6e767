// Tether: what the main job runs. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "settings.hpp"

namespace pendulum {

/// Three situations, as in Hanson and Krogh.
enum class Invariants { none, without_energy, with_energy };

/// One run: which equations, which constraints, how accurate.
struct Case {
  std::string form;  ///< "index 1" or "index 0"
  Invariants invariants = Invariants::none;
  double tolerance = 0.0;  ///< rtol = atol

  bool plain() const { return invariants == Invariants::none; }
  /// Names of the rows as tether_problems knows them.
  std::vector<std::string> rows() const;
  /// "length, velocity, energy"; "none" for plain IDA.
  std::string constraints(const char* separator = ", ") const;
};

/// A pendulum that starts horizontally at rest, watched for some time.
struct Experiment {
  std::string pendulum;           ///< "earth" (1.1 m, standard gravity) or "unit" (1 m, 1 m/s^2)
  double length = 1.0;            ///< L, m
  double gravity = 1.0;           ///< g, m/s^2
  double duration = 10.0;         ///< s
  int repeats = 1;                ///< timed runs of each case, of which the fastest counts
  double drift_tolerance = 1e-6;  ///< whose drift is recorded over time
  std::vector<Case> cases;
};

const std::vector<std::string>& forms();

/// Plain IDA is run at tighter tolerances as well, to see how accurate it can become.
std::vector<Experiment> plan(const Settings& settings);

/// Roughly proportional to the number of steps of a run, and of all runs, observed and timed.
double expected_work(const Experiment& experiment, const Case& what);
double expected_work(const std::vector<Experiment>& experiments);

}  // namespace pendulum
