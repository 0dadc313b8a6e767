// Tether: Newton's method onto the constraints. SPDX-License-Identifier: BSD-3-Clause
#include "movers/mover.hpp"

#include <cmath>

#include "host/mechanisms.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kLargestFloor = 0.1;     // tolerances
constexpr double kStaleRowsSafety = 4.0;  // factor for C of an earlier step
constexpr int kMostTests = 16;            // candidates tested with the factors of an earlier one
constexpr int kUnneededMoves = 8;         // moves below kNothing in a row, then tests begin again
constexpr int kUsualMoves = 3;            // moves with a C that is renewed in each

}  // namespace

Monitor::Verdict Monitor::judge(double length, bool fresh, double floor) {
  ++moves_;
  if (!std::isfinite(length)) return Verdict::failed;
  const double tolerance = options_->advanced.tolerance;
  const bool last = moves_ >= options_->advanced.maximum_iterations;

  if (moves_ == 1) {
    previous_ = length;
    if (length <= floor || leaves_little(length)) return Verdict::done;
    if (last) return length <= tolerance ? Verdict::done : Verdict::failed;
    return Verdict::go_on;
  }

  const double ratio = length / previous_;
  // A second move within rounding says nothing about curvature.
  if (moves_ == 2) curvature_.measured(previous_, previous_, length > 10.0 * floor ? length : 0.0);
  previous_ = length;

  // The rest is at most about length * ratio, and no more than length while ratio <= 1/2.
  if (ratio <= 0.5) {
    if (length * ratio <= tolerance) return Verdict::done;
    return last ? Verdict::failed : Verdict::go_on;
  }
  // Lengths no longer halve: rounding is reached, or the iteration does not converge.
  if (length <= std::max({floor, 1e-5, 0.1 * std::min(1.0, tolerance)})) return Verdict::done;
  if (!fresh && !last) return Verdict::refactor;
  return Verdict::failed;
}

void Mover::reset() {
  rows_->reset();
  monitor_.reset();
  curvature_.reset();
  settles_ = nothing_in_row_ = 0;
  still_ = false;
  move_length_ = 0.0;
}

Status Mover::factor(double t, bool refill) {
  const Status status = rows_->factor(t, refill);
  if (status == Status::success) age_ = 0;
  return status;
}

double Mover::remaining_drift(const Candidate& candidate) {
  if (!rows_->gives_g()) return -1.0;
  rows_->restart(candidate);
  return rows_->value(candidate.t, false) == Status::success ? rows_->drift() : -1.0;
}

// Whether C and the factors of an earlier candidate show that no move is needed. In a run whose
// constraints IDA keeps by itself g is rounding in every step, and evaluating g alone suffices.
bool Mover::clearly_needs_no_move() {
  if (!in_use(Mechanism::tests_before_moves) || !rows_->may_test_with_factors() ||
      tests_ >= kMostTests)
    return false;
  ++tests_;
  ++age_;
  return rows_->rounding_only() || kStaleRowsSafety * rows_->solve(Solve::test).length <= kNothing;
}

Move Mover::measure(const Candidate& candidate) {
  Move result;
  if ((result.status = rows_->load(candidate, true)) != Status::success) return result;
  const bool may_do = rows_->may_test_with_factors() && tests_ < kMostTests;  // with g alone
  result.status = rows_->value(candidate.t, !may_do);
  if (result.status != Status::success) return result;
  result.drift_before = result.drift_after = rows_->drift();
  if (rows_->gives_g() && (result.drift_before == 0.0 || clearly_needs_no_move())) return result;
  tests_ = 0;
  if ((result.status = factor(candidate.t, true)) != Status::success) return result;
  if (rows_->rounding_only()) return result;
  Solution first = rows_->solve(Solve::first);
  // The rows kept by an earlier factorisation suffice to see that no move is needed.
  if (first.status == Status::success && !rows_->decided() && first.length > kNothing) {
    rows_->forget_rank();
    if ((result.status = factor(candidate.t, false)) != Status::success) return result;
    first = rows_->solve(Solve::first);
  }
  result.status = first.status;
  result.length = first.length;
  result.floor = 4.0 * kEpsilon * rows_->size();
  if (result.status == Status::success && rows_->contradicts())
    result.status = Status::inconsistent;
  return result;
}

// The same after moves have begun, once several were not needed: for rows that F contains, or that
// IDA keeps by itself in most steps.
bool Mover::needs_no_move_again(const Candidate& candidate, Move& result) {
  if (!in_use(Mechanism::tests_before_moves) || nothing_in_row_ < kUnneededMoves) return false;
  result.status = rows_->value(candidate.t, false);
  if (result.status != Status::success) return true;
  result.not_needed = still_ = clearly_needs_no_move();
  if (!still_) return false;
  result.drift_before = result.drift_after = rows_->drift();
  move_length_ = 0.0;
  return true;
}

Move Mover::move(const Candidate& candidate) {
  Move result;
  still_ = false;
  result.status = rows_->load(candidate, nothing_in_row_ < kUnneededMoves);
  if (result.status != Status::success || needs_no_move_again(candidate, result)) return result;
  result.status = rows_->value(candidate.t, true);
  if (result.status != Status::success) return result;
  tests_ = 0;
  newton(candidate, result);
  const bool nothing = result.status == Status::success && result.length <= kNothing;
  nothing_in_row_ = nothing ? nothing_in_row_ + 1 : 0;
  const bool broken =
      result.status == Status::not_converged || result.status == Status::move_too_long;
  if (broken || result.moves > kUsualMoves) rows_->refresh_pattern_soon();
  if (result.status == Status::success && !result.capped && rows_->contradicts())
    result.status = Status::inconsistent;
  return result;
}

// Newton's method from the candidate, with g known there.
void Mover::newton(const Candidate& candidate, Move& result) {
  result.drift_before = result.drift_after = rows_->drift();
  monitor_.start();
  bool renew = true;
  for (;;) {
    const bool fresh = renew;  // the factors belong to the present y
    if (renew && (result.status = factor(candidate.t, result.moves == 0)) != Status::success)
      return;
    const Solution found = rows_->solve(renew ? Solve::first : Solve::again);
    if ((result.status = found.status) != Status::success) return;
    if (++result.moves == 1) {
      result.length = move_length_ = found.length;
      if (!(found.length <= options_.advanced.largest_move) && !allowed(candidate, result)) return;
    }
    if ((result.status = rows_->apply(1.0, candidate)) != Status::success) return;
    if (!rows_->gives_g()) break;
    if (result.moves == 1 && found.left == 0.0 && monitor_.plainly_done(found.length)) break;
    Monitor::Verdict verdict = Monitor::Verdict::done;
    if (done(candidate, found, fresh, result, verdict)) break;
    if (result.status != Status::success) return;
    renew = verdict == Monitor::Verdict::refactor;
    if ((result.status = rows_->value(candidate.t, false)) != Status::success) return;
    result.drift_after = rows_->drift();
  }
  result.status = Status::success;
}

// Whether a long first move may be made as it is. False: it was rejected, or made up to the cap.
bool Mover::allowed(const Candidate& candidate, Move& result) {
  const double length = result.length;
  const double limit = options_.advanced.largest_move * std::max(1.0, rows_->change());
  if (length <= limit) return true;
  const bool finite = std::isfinite(length);
  if (options_.advanced.long_move == LongMove::reject || !finite) {
    result.status = finite ? Status::move_too_long : Status::not_finite;
    rows_->message = "the move onto the constraints is " + brief(length) +
                     " tolerances long, the limit is " + brief(limit) +
                     " (Advanced::largest_move); start closer with make_consistent, or use a "
                     "smaller step";
    return false;
  }
  result.left = length - limit;
  result.length = limit;
  result.capped = true;
  result.status = rows_->apply(limit / length, candidate);
  return false;
}

// After a move: whether Newton's method has ended. A status other than success means that it
// failed.
bool Mover::done(const Candidate& candidate, const Solution& found, bool fresh, Move& result,
                 Monitor::Verdict& verdict) {
  const double length = found.length;
  // A first move longer than the largest floor does not need the floor.
  const double floor = result.moves == 1 && length > kLargestFloor
                           ? 0.0
                           : std::min(kLargestFloor, 1e3 * kEpsilon * rows_->size());
  verdict = monitor_.judge(length, fresh, floor);
  // Nearly parallel rows magnify rounding. A move that rounding explains has converged.
  if ((verdict == Monitor::Verdict::failed || verdict == Monitor::Verdict::refactor) &&
      length <= std::min(kLargestFloor, rows_->rounding_length()))
    verdict = Monitor::Verdict::done;
  // If g is rounding the move is meaningless, however long it is.
  if (verdict == Monitor::Verdict::failed && rows_->rounding_only()) {
    result.status = rows_->apply(-1.0, candidate);
    return result.status == Status::success;
  }
  if (verdict == Monitor::Verdict::done && found.left * length <= options_.advanced.tolerance)
    return true;
  if (verdict == Monitor::Verdict::failed || result.moves >= options_.advanced.maximum_iterations) {
    result.status = Status::not_converged;
    rows_->message =
        "move " + std::to_string(result.moves) + " onto the constraints still is " + brief(length) +
        " tolerances long; check the constraint Jacobian with check_jacobian, or whether "
        "the rows have a common solution here; rows written as squares have none but double "
        "roots, and rows with |.| or max no derivative: neither lets Newton's moves shrink";
  }
  return false;
}

Status Mover::settle(const Candidate& candidate, N_Vector change) {
  const double moved = rows_->shift(change);
  return remove_rest(candidate, move_length_ + moved);
}

// Removes what a polish has changed in g, with factors of a point `reach` tolerances away.
Status Mover::remove_rest(const Candidate& candidate, double reach) {
  const bool measure = curvature_.due(reach, ++settles_);
  double previous = 0.0;
  for (int k = 0; k < options_.advanced.maximum_iterations; ++k) {
    Status status = rows_->value(candidate.t, false);
    if (status != Status::success) return status;
    Solution found = rows_->solve(Solve::rest);
    if (still_ && age_ > 0 && found.length > kNothing) {
      if ((status = factor(candidate.t, true)) != Status::success) return status;
      found = rows_->solve(Solve::first);
    }
    if (found.status != Status::success) return found.status;
    if ((status = rows_->apply(1.0, candidate)) != Status::success) return status;
    if ((still_ && age_ > 0) || !rows_->gives_g()) break;  // the move is too short to show a rate
    const double length = found.length;
    const bool enough_done =
        (k > 0 || !measure) && curvature_.left(reach, length) <= options_.advanced.tolerance;
    if (k == 0 && enough_done) break;
    const double floor = 1e2 * kEpsilon * rows_->size();
    const bool rounding = length <= floor || (k > 0 && length > 0.5 * previous);
    if (k > 0) curvature_.measured(reach, previous, rounding ? 0.0 : length);
    if (rounding || enough_done) break;
    previous = length;
  }
  return Status::success;
}

std::unique_ptr<RowsAt> make_rows(const Constraints& constraints, const Options& options,
                                  Statistics& statistics, N_Vector like, int reported) {
  if (has_values(constraints)) {
    const int size = static_cast<int>(N_VGetLength(like));
    return make_contiguous_rows(constraints, options, statistics, size,
                                wants_sparse_factors(constraints, size), reported);
  }
  MakeRows make = make_user_rows;
  if (const auto* rows = std::get_if<Gradients>(&constraints.jacobian)) make = rows->make;
  if (const auto* rows = std::get_if<DistributedRows>(&constraints.jacobian)) make = rows->make;
  return make(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
