// Tether: Newton's method onto the constraints, for every storage of their rows (method, eq. 6, 8).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "host/mechanisms.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"
#include "movers/rows_at.hpp"
#include "rows/row_trust.hpp"

namespace tether::ida_projection {

constexpr double kStaleSafety = 4.0;  ///< for moves by C of another point

/// Factors of a point `reach` tolerances away leave the part kappa reach of a move. Second moves
/// measure kappa, and are made only where it could matter. Measurements only increase kappa; a
/// safety factor of 4 covers that it is measured rarely (method, eq. 8).
class Curvature {
 public:
  /// Whether kappa is to be measured by a second move.
  bool due(double reach, long candidate) const {
    return kappa_ < 0.0 || !(reach <= kStaleSafety * measured_) || candidate % kMeasureEvery == 0;
  }
  /// A second move, after a first one of length `move`, was `left` long.
  void measured(double reach, double move, double left) {
    measured_ = std::max(measured_, reach);
    kappa_ = std::max({kappa_, 0.0, left / (reach * move)});
  }
  /// Length that a move of this length leaves, in tolerances.
  double left(double reach, double length) const { return kStaleSafety * kappa_ * reach * length; }

 private:
  double kappa_ = -1.0;    // for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;  // longest distance at which it was measured
};

/// The moves of a `Storage`, a final class with this base: one loop, compiled for each of them.
template <class Storage>
class Newton : public RowsAt {
 public:
  Newton(Kind of_rows, const Options& options, Statistics& statistics)
      : RowsAt(of_rows), options_(options), statistics_(statistics) {}

  void reset() final {
    run_ = Run();
    self().forget();
  }

  Move measure(const Candidate& candidate) final {
    Storage& rows = self();
    Move result;
    const bool tests = may_test();
    if ((result.status = rows.load(candidate, true)) != Status::success ||
        (result.status = rows.value(candidate.t, !tests)) != Status::success)
      return result;
    result.drift_before = drift;
    const bool given = kind != Kind::projection;
    if (given && (drift == 0.0 || (tests && clearly_needs_no_move()))) return result;
    if ((result.status = renew_factors(candidate.t, true)) != Status::success) return result;
    if (given && rows.is_rounding()) return result;
    const Solution first = rows.solve(Solve::first);
    result.status = first.status;
    result.length = first.length;
    result.floor = 4.0 * rounding_of(candidate);
    if (result.status == Status::success && rows.contradicts())
      result.status = Status::inconsistent;
    return result;
  }

  // After several moves that were not needed g alone is evaluated first: rows may be contained in
  // F, or kept by IDA itself in most steps. Rows that leave no choice are moved by the factors of
  // an earlier candidate as long as moves shrink with these.
  Move move(const Candidate& candidate) final {
    Storage& rows = self();
    Move result;
    const bool tests = run_.nothing_in_row >= kUnneededMoves && may_test();
    const bool keeps = rows.leaves_no_choice() && may_test(), needs_rows = !tests && !keeps;
    if ((result.status = rows.load(candidate, needs_rows)) != Status::success ||
        (result.status = rows.value(candidate.t, needs_rows)) != Status::success)
      return result;
    result.drift_before = drift;
    if (keeps && !tests) ++age;
    if (tests) {
      if (clearly_needs_no_move()) {
        result.not_needed = true;
        run_.length = 0.0;
        return result;
      }
      if (!keeps && (result.status = rows.value(candidate.t, true)) != Status::success)
        return result;
    }
    iterate(candidate, keeps, result);
    const bool nothing = result.status == Status::success && result.length <= kNothing;
    run_.nothing_in_row = nothing ? run_.nothing_in_row + 1 : 0;
    if (result.status != Status::success) {
      if (result.status == Status::not_converged || result.status == Status::move_too_long)
        rows.refresh_pattern_soon();
    } else if (!result.capped && rows.contradicts()) {
      result.status = Status::inconsistent;
    }
    return result;
  }

  // By factors of a point `reach` tolerances away. Where no move was needed they may be those of an
  // earlier candidate: what is left is too short then to show a rate. Rows that leave no choice are
  // settled by these, too, as long as moves shrink as they did before.
  Status settle(const Candidate& candidate, N_Vector change) final {
    Storage& rows = self();
    const double reach = run_.length + rows.follow(candidate, change);
    Curvature& curvature = run_.of_settles;
    const bool measures = curvature.due(reach, ++run_.settles);
    const bool no_choice = rows.leaves_no_choice();
    bool stale = age > 0;
    double previous = 0.0;
    for (int k = 0; k < options_.advanced.maximum_iterations; ++k) {
      Status status = rows.value(candidate.t, false);
      if (status != Status::success) return status;
      Solution found = rows.solve(Solve::rest);
      const bool shrinks = no_choice && (k == 0 || found.length <= kShrinks * previous);
      if (stale && found.length > kNothing && !shrinks) {
        if ((status = rows.factor(candidate.t, true)) != Status::success) return status;
        stale = false;
        found = rows.solve(Solve::first);
      }
      if (found.status != Status::success) return found.status;
      if ((status = rows.apply(1.0, candidate)) != Status::success) return status;
      const double length = found.length;
      if ((stale && length <= kNothing) || kind == Kind::projection) break;
      const double left = stale ? run_.rate * length : curvature.left(reach, length);
      const bool enough_done = (k > 0 || stale || !measures) && left <= options_.advanced.tolerance;
      if (k == 0 && enough_done) break;
      const bool rounding =
          length <= 1e2 * rounding_of(candidate) || (k > 0 && length > 0.5 * previous);
      if (k > 0 && !stale) curvature.measured(reach, previous, rounding ? 0.0 : length);
      if (rounding || enough_done) break;
      previous = length;
    }
    return Status::success;
  }

  /// Whether these rows determine as many unknowns as they are, so that any metric gives the same
  /// move. Storages that can tell hide this one.
  bool leaves_no_choice() const { return false; }

  double remaining_drift(const Candidate& candidate) final {
    if (kind == Kind::projection) return -1.0;
    self().follow(candidate, nullptr);
    return self().value(candidate.t, false) == Status::success ? drift : -1.0;
  }

 protected:
  const Options& options_;
  Statistics& statistics_;

 private:
  static constexpr double kLargestFloor = 0.1;  // tolerances
  static constexpr double kStays = 1e-2;        // tolerances that may be left for good
  static constexpr int kUnneededMoves = 8;      // moves below kNothing in a row, then tests begin
  static constexpr double kShrinks = 0.1;  // of a move: earlier factors that leave more are renewed

  enum class Verdict { done, go_on, refactor, failed };
  // From a new run on.
  struct Run {
    Curvature of_moves, of_settles;
    long candidates = 0, settles = 0;
    double length = 0.0;     // of the last first move, in tolerances
    double rate = 1.0;       // ratio of the last two moves by factors of an earlier candidate
    int nothing_in_row = 0;  // moves that were none
  };

  Storage& self() { return static_cast<Storage&>(*this); }
  // Length of the moves that rounding of y explains: WRMS of y in units of rounding.
  static double rounding_of(const Candidate& candidate) {
    return kEpsilon * N_VWrmsNorm(candidate.base, candidate.weights);
  }
  TETHER_INLINE Status renew_factors(double t, bool refill) {
    const Status status = self().factor(t, refill);
    if (status == Status::success) age = 0;
    return status;
  }
  bool may_test() const {
    return in_use(Mechanism::tests_before_moves) && age < kOneIn && factors == Factors::of_all_rows;
  }
  // Whether C and the factors of an earlier candidate show that no move is needed. In a run whose
  // constraints IDA keeps by itself g is rounding in every step, and evaluating g alone suffices.
  bool clearly_needs_no_move() {
    ++age;
    return self().is_rounding() ||
           kStaleSafety * std::max(self().solve(Solve::test).length, self().solved_length()) <=
               kNothing;
  }

  // Newton's method from the candidate, with g known there. `keeps`: it begins with the factors of
  // an earlier candidate, so that age > 0.
  void iterate(const Candidate& candidate, bool keeps, Move& result) {
    Storage& rows = self();
    ++run_.candidates;
    double previous = -1.0;
    Verdict verdict = keeps ? Verdict::go_on : Verdict::refactor;
    for (;;) {
      const bool fresh = verdict == Verdict::refactor;  // the factors belong to the present y
      if (fresh &&
          (result.status = renew_factors(candidate.t, result.moves == 0)) != Status::success)
        return;
      const Solution found = rows.solve(fresh ? Solve::first : Solve::again);
      if ((result.status = found.status) != Status::success) return;
      if (++result.moves == 1) {
        result.length = run_.length = found.length;
        if (!(found.length <= options_.advanced.largest_move) && !allowed(candidate, result))
          return;
      }
      if ((result.status = rows.apply(1.0, candidate)) != Status::success) return;
      if (kind == Kind::projection) return;
      if (result.moves == 1 && found.left == 0.0 && leaves_little(found.length)) return;
      if (done(candidate, found, previous, fresh, result, &verdict) ||
          result.status != Status::success)
        return;
      previous = found.length;
      if ((result.status = rows.value(candidate.t, false)) != Status::success) return;
    }
  }

  // Whether a long first move may be made as it is. False: it was rejected, or made up to the cap.
  [[gnu::noinline]] bool allowed(const Candidate& candidate, Move& result) {
    const double length = result.length;
    const double limit = options_.advanced.largest_move * std::max(1.0, self().corrected());
    if (length <= limit) return true;
    const bool finite = std::isfinite(length);
    if (options_.advanced.long_move == LongMove::reject || !finite) {
      result.status = finite ? Status::move_too_long : Status::not_finite;
      report.text = "the move onto the constraints is " + brief(length) +
                    " tolerances long, the limit is " + brief(limit) +
                    " (Advanced::largest_move); start closer with make_consistent, or use a "
                    "smaller step";
      return false;
    }
    result.left = length - limit;
    result.length = limit;
    result.capped = true;
    result.status = self().apply(limit / length, candidate);
    return false;
  }

  // Newton's second move has the length kappa d^2, about.
  bool leaves_little(double length) const {
    return age == 0 && !run_.of_moves.due(length, run_.candidates) &&
           run_.of_moves.left(length, length) <= options_.advanced.tolerance;
  }

  // After a move of this length; `fresh`: the factors belong to the point that was left; `floor`:
  // length below which rounding of y rules.
  Verdict judge(double length, double previous, const Move& made, bool fresh, double floor) {
    if (!std::isfinite(length)) return Verdict::failed;
    const double tolerance = options_.advanced.tolerance;
    const bool last = made.moves >= options_.advanced.maximum_iterations;
    if (made.moves == 1) {
      if (length <= floor || leaves_little(length)) return Verdict::done;
      if (last) return length <= tolerance ? Verdict::done : Verdict::failed;
      return Verdict::go_on;
    }
    // A second move within rounding says nothing about curvature.
    if (made.moves == 2 && age == 0)
      run_.of_moves.measured(previous, previous, length > 10.0 * floor ? length : 0.0);
    // The rest is at most about length * ratio, and no more than length while ratio <= 1/2.
    const double ratio = length / previous;
    if (age > 0) run_.rate = ratio;
    if (ratio <= (age > 0 ? kShrinks : 0.5)) {
      if (length * ratio <= tolerance) return Verdict::done;
      if (!last) return Verdict::go_on;
    } else if (length <= std::max({floor, 1e-5, 0.1 * std::min(1.0, tolerance)})) {
      return Verdict::done;
    } else if (!fresh && !last) {
      return Verdict::refactor;
    }
    // Lengths no longer halve. Rounding, and differences in place of C, leave that much where rows
    // are nearly parallel. A longer move, or more to come at this rate, is no convergence: C may be
    // wrong by a factor.
    const double rest = ratio < 1.0 ? length * ratio / (1.0 - ratio) : length;
    return std::max(length, rest) <= kStays ? Verdict::done : Verdict::failed;
  }

  // After a move: whether Newton's method has ended. A status other than success means that it
  // failed.
  [[gnu::noinline]] bool done(const Candidate& candidate, const Solution& found, double previous,
                              bool fresh, Move& result, Verdict* verdict) {
    const double length = found.length;
    // A first move longer than the largest floor does not need the floor.
    const double floor = result.moves == 1 && length > kLargestFloor
                             ? 0.0
                             : std::min(kLargestFloor, 1e3 * rounding_of(candidate));
    *verdict = judge(length, previous, result, fresh, floor);
    // If g is rounding the move is meaningless, however long it is.
    if (*verdict == Verdict::failed && self().is_rounding()) {
      result.status = self().apply(-1.0, candidate);
      return result.status == Status::success;
    }
    const double tolerance = options_.advanced.tolerance;
    if (*verdict == Verdict::done && found.left * length <= tolerance) return true;
    if (*verdict != Verdict::failed && result.moves < options_.advanced.maximum_iterations)
      return false;
    result.status = Status::not_converged;
    report.text =
        "move " + std::to_string(result.moves) + " onto the constraints still is " + brief(length) +
        " tolerances long; check the constraint Jacobian with check_jacobian, or whether "
        "the rows have a common solution here; rows written as squares have none but double "
        "roots, and rows with |.| or max no derivative: neither lets Newton's moves shrink";
    return false;
  }

  Run run_;
};

}  // namespace tether::ida_projection
