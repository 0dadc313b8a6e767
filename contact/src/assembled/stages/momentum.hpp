// Tether: sweeps with momentum (method, section 4). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/system.hpp"

namespace tether::contact::detail {

/// x = g + beta (g - the g before) after each sweep from x to g, with Nesterov's beta, dropped
/// where the change of a sweep rises. Where contacts still pass from one regime to another it needs
/// a third to a half of the sweeps, and it forgets what was before such a passage by itself.
class Momentum {
 public:
  static constexpr double kCost = 3;  // ns a contact

  void reset(int contacts) { before_.resize(at(contacts)); }
  /// The next step has none.
  void rest() { grown_ = 1; }
  /// The next x; f: size of the change from x to g, which is given away.
  void step(const Problem& problem, double f, Packed& g, Packed& x);

 private:
  double grown_ = 1;   // 1 at rest
  double last_f_ = 0;  // of the sweep before
  Packed before_;
};

}  // namespace tether::contact::detail
