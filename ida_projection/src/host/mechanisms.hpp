// Tether: the mechanisms beyond the published method, by name. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstddef>
#ifdef TETHER_ABLATION
#include <array>
#include <cstdlib>
#include <string>
#endif

namespace tether::ida_projection {

/// Each has its row in benchmarks/results/ablation.md: what a run loses without it. Options switch
/// the others: metric, polish, smoothing, limit of the order, index and suppression.
enum class Mechanism {
  repeated_correction,    ///< after a stale Jacobian has fooled IDA's test
  polish_first,           ///< the polish precedes the move
  forecast_polish,        ///< the polish is forecast without an evaluation of F
  followers,              ///< IDA's test waits for algebraic variables that follow
  multipliers_apart,      ///< Newton's test judges multipliers of index 2 by a rate of their own
  widened_tolerance,      ///< for algebraic variables that respond to moves
  index_in_trouble,       ///< the index of F is found when error tests fail
  stricter_setpoint,      ///< smaller errors in index 2, by tolerance and order
  tested_long_moves,      ///< the error test sees the correction before a long move, too
  row_trust,              ///< thin rows count only as far as C can be trusted
  rows_left_out,          ///< the least independent row, where moves onto all do not converge
  kept_rank,              ///< independent rows are determined now and then only
  tests_before_moves,     ///< g alone shows that rows need no move
  rate_limit,             ///< scales of positions are at most h times those of velocities
  other_metric,           ///< one scale for each level, where stiff components respond to moves
  expected_oscillations,  ///< the order is limited earlier after stiff responses
  joined_equations,       ///< equations of F move with rows that need them
  false_row_watch,        ///< rows that F does not keep are named
  count
};

inline constexpr const char* kMechanismNames[] = {
    "repeated correction", "polish first",      "forecast polish",  "followers",
    "multipliers apart",   "widened tolerance", "index in trouble", "stricter setpoint",
    "tested long moves",   "row trust",         "rows left out",    "kept rank",
    "tests before moves",  "rate limit",        "other metric",     "expected oscillations",
    "joined equations",    "false-row watch"};
static_assert(sizeof kMechanismNames / sizeof *kMechanismNames ==
              static_cast<std::size_t>(Mechanism::count));

#ifdef TETHER_ABLATION
/// Those in use: all but what the environment variable TETHER_WITHOUT names, with commas between.
inline std::array<bool, static_cast<std::size_t>(Mechanism::count)> mechanisms_in_use() {
  const char* const names = std::getenv("TETHER_WITHOUT");
  const std::string without = "," + std::string(names != nullptr ? names : "") + ",";
  std::array<bool, static_cast<std::size_t>(Mechanism::count)> used{};
  for (std::size_t i = 0; i < used.size(); ++i)
    used[i] = without.find("," + std::string(kMechanismNames[i]) + ",") == std::string::npos;
  return used;
}
inline bool in_use(Mechanism mechanism) {
  static const auto used = mechanisms_in_use();
  return used[static_cast<std::size_t>(mechanism)];
}
#else
constexpr bool in_use(Mechanism) { return true; }
#endif

}  // namespace tether::ida_projection
