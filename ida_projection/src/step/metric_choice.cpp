// Tether: which metric moves are made in. SPDX-License-Identifier: BSD-3-Clause
#include "step/metric_choice.hpp"

namespace tether::ida_projection {

// A move that disturbs stiff components makes them oscillate; the metric, built from those
// oscillations, then makes worse moves. The other metric has one scale for each level of unknowns,
// or one for each unknown.
Move MetricChoice::improved(const Candidate& candidate, Move move, RowsAt& rows, Polish& polish,
                            bool high_index) {
  if (!due()) return move;
  MoveAndResponse at{move.length, polish.response_length(candidate)};
  if (at.response < 0.0) return move;
  const auto again = [&] {  // from the corrector's point
    polish.restore(candidate);
    return rows.move(candidate);
  };
  if (doubts(at)) {
    if (!rows.use_levels(!by_levels_)) {
      found_none();
    } else {
      const Move other = again();
      const bool moved = other.status == Status::success && !other.capped;
      const MoveAndResponse its{other.length, moved ? polish.response_length(candidate) : -1.0};
      if (its.response < 0.0) found_none();
      if (its.response >= 0.0 && prefers(its, at)) {
        move = other;
        at = its;
      } else {
        rows.use_levels(by_levels_);
        move = again();
      }
    }
  }
  // Multipliers of index 2 respond to any move, by more than its length divided by h. Their
  // response says nothing of stiffness.
  if (high_index && stiff(at)) pause();
  return move;
}

}  // namespace tether::ida_projection
