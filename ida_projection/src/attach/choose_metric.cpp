// Tether: the metric of moves to which stiff components respond. SPDX-License-Identifier:
// BSD-3-Clause
#include "attach/impl.hpp"
#include "host/mechanisms.hpp"

namespace tether::ida_projection {

// Whether the metric may be changed and the response of F is available.
bool Projection::Impl::may_change_metric() const {
  return in_use(Mechanism::other_metric) && movers_.used->rows().may_use_levels() &&
         wanted_metric_ == Metric::automatic && options_.group.empty() &&
         options_.advanced.metric == Metric::local_correction &&
         movers_.used == movers_.own.get() && unknowns_.contiguous &&
         polish_.is_response_available();
}

// A move that disturbs stiff components makes them oscillate; the metric, built from those
// oscillations, then makes worse moves.
void Projection::Impl::choose_metric(const Candidate& candidate, Move& move) {
  if (move.status != Status::success || !may_change_metric() || !metric_choice_.due()) return;
  MoveAndResponse at{move.length, polish_.response_length(candidate)};
  if (at.response < 0.0) return;
  if (metric_choice_.doubts(at)) at = try_other_metric(candidate, at, move);
  // Multipliers of index 2 respond to any move, by more than its length divided by h. Their
  // response says nothing of stiffness.
  if (metric_choice_.stiff(at) && variables_.high_index()) metric_choice_.pause();
}

// Repeats the move from the corrector's point in the other metric, which then stays: one scale for
// each level of unknowns, or a scale for each unknown.
Move Projection::Impl::move_by_levels(const Candidate& candidate, bool by_levels) {
  movers_.used->rows().use_levels(by_levels);
  polish_.restore(candidate);
  return movers_.used->move(candidate);
}

MoveAndResponse Projection::Impl::try_other_metric(const Candidate& candidate,
                                                   const MoveAndResponse& present, Move& move) {
  const bool by_levels = metric_choice_.by_levels();
  if (!movers_.used->rows().use_levels(!by_levels)) {
    metric_choice_.found_none();
    return present;
  }
  const Move other = move_by_levels(candidate, !by_levels);
  const bool moved = other.status == Status::success && !other.capped;
  const MoveAndResponse its{other.length, moved ? polish_.response_length(candidate) : -1.0};
  if (its.response >= 0.0 && metric_choice_.prefers(its, present)) {
    move = other;
    if (in_use(Mechanism::expected_oscillations)) control_.expect_oscillations();
    return its;
  }
  if (its.response < 0.0) metric_choice_.found_none();
  move = move_by_levels(candidate, by_levels);
  return present;
}

}  // namespace tether::ida_projection
