// Tether: a move with factors of an earlier step, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "contiguous_mover.hpp"

namespace tether::ida_projection {

template <class Rows>
Move ContiguousMover<Rows>::follow(const Candidate& candidate, bool again) {
  rows_.at.load(candidate);
  if (!again) {
    rows_.set_metric(false);
    ++kept_.age;
    rows_.factors.decided = false;
  }
  return move_with_old_factors(
      wear_, [&] { return rows_.value(candidate.t); }, [&] { return rows_.solve(); },
      [&] { rows_.apply(1.0, candidate.correction_entries); }, [&] { return rows_.drift(); },
      1e2 * kEpsilon * rows_.at.size(), options_.largest_move, kMayFollowLeave);
}

template Move ContiguousMover<RowBlocks>::follow(const Candidate&, bool);
template Move ContiguousMover<SparseRows>::follow(const Candidate&, bool);

}  // namespace tether::ida_projection
