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
  repeated_correction,    ///< where a stale Jacobian fooled IDA's convergence test
  polish_first,           ///< of many rows: before the move
  foretold_polish,        ///< from earlier ones, without an evaluation of F
  followers,              ///< IDA's test waits for algebraic variables that follow
  free_multipliers,       ///< those of index 2 are left out of IDA's convergence test
  widened_tolerance,      ///< of algebraic variables that respond to moves
  index_in_trouble,       ///< F is asked for its index where error tests fail
  care,                   ///< smaller errors in index 2, by tolerance and order
  tested_long_moves,      ///< the error test sees the correction before a long move, too
  row_trust,              ///< thin rows count only as far as C can be trusted
  kept_rank,              ///< which rows are independent is found out now and then
  looks,                  ///< rows that need no move are only evaluated
  rate_limit,             ///< scales of positions are at most h times those of velocities
  other_metric,           ///< one scale for each level, where stiff components respond to moves
  expected_oscillations,  ///< the order is limited after that
  joined_equations,       ///< of F, to rows that contain their algebraic variables
  false_row_watch,        ///< rows that F does not keep are named
  count
};

inline constexpr const char* kMechanismNames[] = {"repeated correction",
                                                  "polish first",
                                                  "foretold polish",
                                                  "followers",
                                                  "free multipliers",
                                                  "widened tolerance",
                                                  "index in trouble",
                                                  "care",
                                                  "tested long moves",
                                                  "row trust",
                                                  "kept rank",
                                                  "looks",
                                                  "rate limit",
                                                  "other metric",
                                                  "expected oscillations",
                                                  "joined equations",
                                                  "false-row watch"};
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
