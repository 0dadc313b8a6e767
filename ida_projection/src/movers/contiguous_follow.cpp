// Tether: a move with factors of an earlier step, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "movers/contiguous_mover.hpp"

namespace tether::ida_projection {

template <class Rows>
Move ContiguousMover<Rows>::follow(const Candidate& candidate, bool again) {
  at_.load(candidate);
  if (!again) {
    set_metric(false);
    ++age_;
    decided_ = false;
  }
  return move_with_old_factors(
      wear_, [&] { return value(candidate.t); }, [&] { return solve(); },
      [&] { apply(1.0, candidate.correction_entries); }, [&] { return drift(); },
      1e2 * kEpsilon * at_.size(), options_.largest_move, kMayFollowLeave);
}

template Move ContiguousMover<RowBlocks>::follow(const Candidate&, bool);
template Move ContiguousMover<SparseRows>::follow(const Candidate&, bool);

}  // namespace tether::ida_projection
