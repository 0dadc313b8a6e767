// Tether: one hard case and what became of it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace tether::hard_cases {

struct Outcome {
  std::string plain;  ///< what plain IDA does
  std::string ours;
  std::vector<std::string> peers;  ///< in the order of peer_names(); may be empty
  bool right = false;              ///< ours is the right answer, or refuses what has none
};

struct HardCase {
  std::string name, regime, oracle;
  std::function<Outcome()> run;
};

/// Start values or constraints without a right answer: they must be refused, in words.
std::vector<HardCase> refusals();

}  // namespace tether::hard_cases
