// Tether: what becomes of moves to which stiff components answer. SPDX-License-Identifier:
// BSD-3-Clause
#include "attach/impl.hpp"
#include "host/mechanisms.hpp"

namespace tether::ida_projection {

// Is the metric free, and can answers to moves be had?
bool Projection::Impl::hears_answers() const {
  return wanted_metric_ == Metric::automatic && options_.group.empty() &&
         options_.advanced.metric == Metric::local_correction &&
         movers_.used == movers_.own.get() && polish_.hears_answers();
}

bool Projection::Impl::asks_for_metric() const {
  return movers_.used->may_use_levels() && hears_answers();
}

// Moves to which stiff components answer excite them, and scales made of what they then do make
// the next moves worse. True: they answer to the best move there is.
bool Projection::Impl::choose_metric(const Candidate& candidate, Move& move) {
  if (!in_use(Mechanism::other_metric) || move.status != Status::success || !asks_for_metric())
    return false;
  if (!metric_choice_.due()) return false;
  AnsweredMove at{move.length, polish_.answer(candidate)};
  if (at.answer < 0.0) return false;
  // So they do in index 0, where F keeps them by a derivative of theirs.
  if (metric_choice_.stiff(at) && !variables_.any() && movers_.used->has_forces_in_rows()) {
    metric_choice_.pause();
    return false;
  }
  if (metric_choice_.doubts(at)) at = try_other_metric(candidate, at, move);
  if (!metric_choice_.stiff(at)) return false;
  // Multipliers of index 2 answer to any move, by more than its length over h.
  if (variables_.high_index()) metric_choice_.pause();
  return !variables_.high_index();
}

// The move from where the corrector was, one scale for each level, or each its own, from now on.
Move Projection::Impl::move_by_levels(const Candidate& candidate, bool by_levels) {
  movers_.used->use_levels(by_levels);
  polish_.restore(candidate);
  return movers_.used->move(candidate);
}

AnsweredMove Projection::Impl::try_other_metric(const Candidate& candidate,
                                                const AnsweredMove& present, Move& move) {
  const bool by_levels = metric_choice_.by_levels();
  if (!movers_.used->use_levels(!by_levels)) {
    metric_choice_.found_none();
    return present;
  }
  const Move other = move_by_levels(candidate, !by_levels);
  const bool moved = other.status == Status::success && !other.capped;
  const AnsweredMove its{other.length, moved ? polish_.answer(candidate) : -1.0};
  if (its.answer >= 0.0 && metric_choice_.prefers(its, present)) {
    move = other;
    if (in_use(Mechanism::expected_oscillations)) control_.expect_oscillations();
    return its;
  }
  if (its.answer < 0.0) metric_choice_.found_none();
  move = move_by_levels(candidate, by_levels);
  return present;
}

// Its answers are part of it: of the iteration after moves, what IDA's own test left is still due.
Status Projection::Impl::settle_stiff_move(const Candidate& candidate, double cj,
                                           double tolerance) {
  polish_.leave_answers_out();
  if (options_.advanced.polish != Polished::none &&
      polish_.add_newton_step(candidate, cj, tolerance))
    N_VLinearSum(1.0, stiff_move_.change(), 1.0, polish_.delta(), stiff_move_.change());
  return movers_.used->settle(candidate, stiff_move_.change());
}

}  // namespace tether::ida_projection
