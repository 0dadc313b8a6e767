// Tether: Newton's method onto the constraints. SPDX-License-Identifier: BSD-3-Clause
#include "movers/mover.hpp"

#include <cmath>

#include "host/mechanisms.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kLargestFloor = 0.1;  // tolerances
constexpr int kMostTests = 16;         // candidates tested with the factors of an earlier one
constexpr int kUnneededMoves = 8;      // moves below kNothing in a row, then tests begin again
constexpr int kUsualMoves = 3;         // moves with a C that is renewed in each

// Length of the moves that rounding of y explains: WRMS of y in units of rounding.
double rounding_of(const Candidate& candidate) {
  return kEpsilon * N_VWrmsNorm(candidate.base, candidate.weights);
}

}  // namespace

Status Mover::factor(double t, bool refill) {
  const Status status = rows_->factor(t, refill);
  if (status == Status::success) age_ = 0;
  return status;
}

double Mover::remaining_drift(const Candidate& candidate) {
  if (rows_->kind == RowsAt::Kind::projection) return -1.0;
  rows_->follow(candidate, nullptr);
  return rows_->value(candidate.t, false) == Status::success ? rows_->drift : -1.0;
}

bool Mover::may_test() const {
  return in_use(Mechanism::tests_before_moves) && age_ < kMostTests &&
         rows_->factors == RowsAt::Factors::of_all_rows;
}

// Whether C and the factors of an earlier candidate show that no move is needed. In a run whose
// constraints IDA keeps by itself g is rounding in every step, and evaluating g alone suffices.
bool Mover::clearly_needs_no_move() {
  if (!may_test()) return false;
  ++age_;
  return rows_->is_rounding() || kStaleSafety * rows_->solve(Solve::test).length <= kNothing;
}

Move Mover::measure(const Candidate& candidate) {
  Move result;
  if ((result.status = rows_->load(candidate, true)) != Status::success ||
      (result.status = rows_->value(candidate.t, !may_test())) != Status::success)
    return result;
  result.drift_before = result.drift_after = rows_->drift;
  const bool given = rows_->kind != RowsAt::Kind::projection;
  if (given && (result.drift_before == 0.0 || clearly_needs_no_move())) return result;
  if ((result.status = factor(candidate.t, true)) != Status::success) return result;
  if (given && rows_->is_rounding()) return result;
  const Solution first = rows_->solve(Solve::first);
  result.status = first.status;
  result.length = first.length;
  result.floor = 4.0 * rounding_of(candidate);
  if (result.status == Status::success && rows_->contradicts())
    result.status = Status::inconsistent;
  return result;
}

// After several moves that were not needed g alone is evaluated first: rows may be contained in F,
// or kept by IDA itself in most steps.
Move Mover::move(const Candidate& candidate) {
  Move result;
  const bool may_be_none = run_.nothing_in_row >= kUnneededMoves && may_test();
  if ((result.status = rows_->load(candidate, !may_be_none)) != Status::success ||
      (result.status = rows_->value(candidate.t, !may_be_none)) != Status::success)
    return result;
  result.drift_before = result.drift_after = rows_->drift;
  if (may_be_none && clearly_needs_no_move()) {
    result.not_needed = true;
    run_.length = 0.0;
    return result;
  }
  if (may_be_none && (result.status = rows_->value(candidate.t, true)) != Status::success)
    return result;
  newton(candidate, result);
  const bool nothing = result.status == Status::success && result.length <= kNothing;
  run_.nothing_in_row = nothing ? run_.nothing_in_row + 1 : 0;
  const bool broken =
      result.status == Status::not_converged || result.status == Status::move_too_long;
  if (broken) rows_->refresh_pattern_soon();
  if (result.status == Status::success && !result.capped && rows_->contradicts())
    result.status = Status::inconsistent;
  return result;
}

// Newton's method from the candidate, with g known there.
void Mover::newton(const Candidate& candidate, Move& result) {
  ++run_.candidates;
  double previous = -1.0;
  Verdict verdict = Verdict::refactor;
  for (;;) {
    const bool fresh = verdict == Verdict::refactor;  // the factors belong to the present y
    if (fresh && (result.status = factor(candidate.t, result.moves == 0)) != Status::success)
      return;
    const Solution found = rows_->solve(fresh ? Solve::first : Solve::again);
    if ((result.status = found.status) != Status::success) return;
    if (++result.moves == 1) {
      result.length = run_.length = found.length;
      if (!(found.length <= options_.advanced.largest_move) && !allowed(candidate, result)) return;
    }
    if ((result.status = rows_->apply(1.0, candidate)) != Status::success) return;
    if (rows_->kind == RowsAt::Kind::projection) return;
    if (result.moves == 1 && found.left == 0.0 && leaves_little(found.length)) return;
    if (done(candidate, found, previous, fresh, result, &verdict) ||
        result.status != Status::success)
      return;
    previous = found.length;
    if ((result.status = rows_->value(candidate.t, false)) != Status::success) return;
    result.drift_after = rows_->drift;
  }
}

// Whether a long first move may be made as it is. False: it was rejected, or made up to the cap.
bool Mover::allowed(const Candidate& candidate, Move& result) {
  const double length = result.length;
  const double limit = options_.advanced.largest_move * std::max(1.0, rows_->corrected());
  if (length <= limit) return true;
  const bool finite = std::isfinite(length);
  if (options_.advanced.long_move == LongMove::reject || !finite) {
    result.status = finite ? Status::move_too_long : Status::not_finite;
    rows_->report.text = "the move onto the constraints is " + brief(length) +
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

// Newton's second move has the length kappa d^2, about.
bool Mover::leaves_little(double length) const {
  return !run_.of_moves.due(length, run_.candidates) &&
         run_.of_moves.left(length, length) <= options_.advanced.tolerance;
}

// After a move of this length; `fresh`: the factors belong to the point that was left; `floor`:
// length below which rounding of y rules.
Mover::Verdict Mover::judge(double length, double previous, const Move& made, bool fresh,
                            double floor) {
  if (!std::isfinite(length)) return Verdict::failed;
  const double tolerance = options_.advanced.tolerance;
  const bool last = made.moves >= options_.advanced.maximum_iterations;
  if (made.moves == 1) {
    if (length <= floor || leaves_little(length)) return Verdict::done;
    if (last) return length <= tolerance ? Verdict::done : Verdict::failed;
    return Verdict::go_on;
  }
  // A second move within rounding says nothing about curvature.
  if (made.moves == 2)
    run_.of_moves.measured(previous, previous, length > 10.0 * floor ? length : 0.0);
  // The rest is at most about length * ratio, and no more than length while ratio <= 1/2.
  const double ratio = length / previous;
  if (ratio <= 0.5) {
    if (length * ratio <= tolerance) return Verdict::done;
    return last ? Verdict::failed : Verdict::go_on;
  }
  // Lengths no longer halve: rounding is reached, or the iteration does not converge.
  if (length <= std::max({floor, 1e-5, 0.1 * std::min(1.0, tolerance)})) return Verdict::done;
  return fresh || last ? Verdict::failed : Verdict::refactor;
}

// After a move: whether Newton's method has ended. A status other than success means that it
// failed.
bool Mover::done(const Candidate& candidate, const Solution& found, double previous, bool fresh,
                 Move& result, Verdict* verdict) {
  const double length = found.length;
  // A first move longer than the largest floor does not need the floor.
  const double floor = result.moves == 1 && length > kLargestFloor
                           ? 0.0
                           : std::min(kLargestFloor, 1e3 * rounding_of(candidate));
  *verdict = judge(length, previous, result, fresh, floor);
  // Nearly parallel rows magnify rounding. A move that rounding explains has converged.
  if ((*verdict == Verdict::failed || *verdict == Verdict::refactor) && length <= kLargestFloor &&
      rows_->is_rounding(length))
    *verdict = Verdict::done;
  // If g is rounding the move is meaningless, however long it is.
  if (*verdict == Verdict::failed && rows_->is_rounding()) {
    result.status = rows_->apply(-1.0, candidate);
    return result.status == Status::success;
  }
  const double tolerance = options_.advanced.tolerance;
  if (*verdict == Verdict::done && found.left * length <= tolerance) return true;
  if (*verdict != Verdict::failed && result.moves < options_.advanced.maximum_iterations)
    return false;
  result.status = Status::not_converged;
  rows_->report.text =
      "move " + std::to_string(result.moves) + " onto the constraints still is " + brief(length) +
      " tolerances long; check the constraint Jacobian with check_jacobian, or whether "
      "the rows have a common solution here; rows written as squares have none but double "
      "roots, and rows with |.| or max no derivative: neither lets Newton's moves shrink";
  return false;
}

// Removes what a polish has changed in g, with factors of a point `reach` tolerances away. Where no
// move was needed they may be those of an earlier candidate: what is left is too short then to show
// a rate.
Status Mover::settle(const Candidate& candidate, N_Vector change) {
  const double reach = run_.length + rows_->follow(candidate, change);
  Curvature& curvature = run_.of_settles;
  const bool measure = curvature.due(reach, ++run_.settles);
  bool stale = age_ > 0;
  double previous = 0.0;
  for (int k = 0; k < options_.advanced.maximum_iterations; ++k) {
    Status status = rows_->value(candidate.t, false);
    if (status != Status::success) return status;
    Solution found = rows_->solve(Solve::rest);
    if (stale && found.length > kNothing) {
      if ((status = rows_->factor(candidate.t, true)) != Status::success) return status;
      stale = false;
      found = rows_->solve(Solve::first);
    }
    if (found.status != Status::success) return found.status;
    if ((status = rows_->apply(1.0, candidate)) != Status::success) return status;
    if (stale || rows_->kind == RowsAt::Kind::projection) break;
    const double length = found.length;
    const bool enough_done =
        (k > 0 || !measure) && curvature.left(reach, length) <= options_.advanced.tolerance;
    if (k == 0 && enough_done) break;
    const bool rounding =
        length <= 1e2 * rounding_of(candidate) || (k > 0 && length > 0.5 * previous);
    if (k > 0) curvature.measured(reach, previous, rounding ? 0.0 : length);
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
