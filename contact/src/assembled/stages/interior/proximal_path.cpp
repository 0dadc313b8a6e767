// Tether: proximal point iteration by Newton steps and interior points. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/interior/interior_point.hpp"

#include <algorithm>

namespace tether::contact::detail {

// Implicit Euler steps 1 / tau of D x' = -F(x): where the contacts that stick and slide admit no
// solution, x drifts at a constant rate until one of them changes (method, section 6).
void InteriorPoint::run_proximal(Search& search, const PackedVector* x, int most,
                                 ProximalNewton& newton, bool whole) {
  constexpr int kCorrections = 4, kSteps = 20, kSweeps = 3;
  constexpr double kFirst = 1e-2, kLeast = 1e-9, kMost = 1;  // tau, for ordinary loads
  constexpr double kLightest = 1e6, kNear = 1e-4;
  System& system = search.system;
  Packed rate(at(n_)), point(at(n_));  // rate: tau (x_k+1 - x_k)
  equations_.set_anchor(x);
  const Packed& anchor = equations_.anchor();
  // Impulses that carry heavy bodies over light ones are |A| |x| times what moves; for x to change
  // by its size at the rate of what is left tau has to be as much smaller.
  const double lighter = std::min(kLightest, std::max(1.0, system.load(x) / kOrdinaryLoad));
  const double least = kLeast / lighter;
  double tau = kFirst / lighter;
  bool drifting = false;
  for (int outer = 0; outer < most; ++outer) {
    int corrections = 0;
    if (drifting) {
      for (int i = 0; i < n_; ++i)
        for (int c = 0; c < 3; ++c) point[at(i)].v[c] = anchor[at(i)].v[c] + rate[at(i)].v[c] / tau;
      corrections = newton.correct(search, tau, anchor.data(), point, kCorrections);
    }
    bool found = corrections > 0;
    if (!found) {
      // Half the natural map of the problem itself at the anchor is enough: with more accuracy the
      // iteration is no better, with more steps each.
      equations_.set_tau(0);
      const double before = equations_.natural_map(system, anchor.data());
      if (!start_proximal(search, tau, kNear)) break;
      found = follow(search, kSteps, 0.5 * before) <= 0.8 * before;
      equations_.set_tau(0);
      search.test(equations_.impulses().data(), By::factors);
      if (search.solved()) break;
      if (found) point = equations_.impulses();
    }
    if (search.exhausted() || (!found && !whole)) break;
    if (!found) {
      tau = std::min(kMost, 3 * tau);
      continue;
    }
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < 3; ++c) rate[at(i)].v[c] = tau * (point[at(i)].v[c] - anchor[at(i)].v[c]);
    drifting = true;
    equations_.set_anchor(point.data());
    search.test(anchor.data(), By::factors);
    // Sweeps remove errors of single contacts.
    swept_ = anchor;
    for (int k = 0; k < kSweeps && !search.solved(); ++k) {
      system.sweep(swept_.data());
      search.count_sweep();
    }
    if (!search.solved()) search.test(swept_.data(), By::factors);
    if (search.solved()) break;
    tau = std::max(least, (corrections == 1 ? 0.4 : 0.5) * tau);
  }
  equations_.set_tau(0);
}

}  // namespace tether::contact::detail
