// Tether: the move onto constraints through N_Vectors alone. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "attach/shortest.hpp"
#include "host/owned_vector.hpp"
#include "movers/factor_wear.hpp"
#include "movers/mover.hpp"
#include "movers/vector/vector_metric.hpp"
#include "rows/rounding.hpp"

namespace tether::ida_projection {

constexpr double kNoMove = 1e-9;  // tolerances: no move at all

/// Moves candidates on any N_Vector.
///
/// `Rows` keeps g, C and the factors of C D:
///
///     Status value(t, y), fill(t, y), factor(metric, terms_at), all counted in the statistics;
///                                 `terms_at`: y for rounding_only(), or null
///     double drift()              largest |g_i|
///     void solve(D, dy)           the shortest D^-1 dy with C dy = g
///     double left()               what solve() leaves of its solution
///     bool contains_algebraic(id), whole(), rounding_only()
///     bool contradict(dy)         after solve()
///
/// and `report`: text, rows and whether a callback asked for the end. Vectors may be spread over
/// processes: all of these have the same outcome on every one.
template <class Rows>
class VectorMover final : public Mover {
 public:
  VectorMover(const Constraints& constraints, const Options& options, Statistics& statistics,
              N_Vector like)
      : options_(options),
        statistics_(statistics),
        monitor_(options),
        y_(like),
        dy_(like),
        work_(like),
        metric_(options, like),
        rows_(constraints, statistics, like) {
    free_all();
    reset();
  }

  void expect_no_settle(bool none) override { no_settle_ = none; }
  void accept() override { metric_.accept(); }
  bool metric(N_Vector D) const override {
    N_VScale(1.0, metric_.D(), D);
    return factored_;
  }
  void reset() override {
    metric_.reset();
    monitor_.reset();
    wear_ = FactorWear();
    factored_ = false;
  }

  // Algebraic components are held as long as no row contains them.
  Status set_algebraic(const Candidate& candidate, N_Vector id) override {
    id_ = id;
    free_all();
    if (id == nullptr) return Status::success;
    load(candidate);
    if (fatal_) return Status::callback_fatal;
    const Status status = told(rows_.fill(candidate.t, y_));
    if (status != Status::success) return status;
    holds_algebraic_ = !rows_.contains_algebraic(id);
    if (holds_algebraic_) metric_.hold_all_but(id);
    return Status::success;
  }

  Status settle(const Candidate& candidate, N_Vector change) override {
    N_VLinearSum(1.0, y_, 1.0, change, y_);
    const Status status = value(candidate.t);
    if (status != Status::success) return status;
    solve(candidate.weights);
    N_VLinearSum(1.0, candidate.correction, -1.0, dy_, candidate.correction);
    return Status::success;
  }

  double remaining_drift(const Candidate& candidate) override {
    N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
    return value(candidate.t) == Status::success ? drift() : -1.0;
  }

  Move measure(const Candidate& candidate) override {
    Move result;
    load(candidate);
    if ((result.status = value(candidate.t)) != Status::success) return result;
    result.drift_before = result.drift_after = drift();
    if (result.drift_before == 0.0) return result;
    if (factors_last() && wear_.usable()) {
      const double length = solve(candidate.weights);
      if (length <= kNoMove) {
        result.length = length;
        return result;
      }
    }
    metric_.set(candidate, dy_);
    if ((result.status = factor(candidate, y_)) != Status::success) return result;
    if (rows_.rounding_only()) return result;
    result.length = solve(candidate.weights);
    result.floor = 4.0 * kEpsilon * N_VWrmsNorm(y_, candidate.weights);
    if (contradicts()) result.status = Status::inconsistent;
    return result;
  }

  // A short move by factors of an earlier step leaves a part of itself that their age tells; where
  // that is too much Newton's method goes on from where it ends.
  Move move(const Candidate& candidate) override {
    constexpr double kShort = 0.1, kSafe = 0.25;
    Move result;
    if (factors_last() && wear_.usable()) {
      load(candidate);
      result = chord_moves(candidate, kShort, kSafe * options_.advanced.tolerance);
      if (result.status == Status::success || fatal_) return result;
    }
    const double moved = result.length;
    result = newton(candidate);
    result.length += moved;
    return result;
  }

 private:
  // Error weights change slowly, and so do factors in their metric. What follows a polish is taken
  // back with the factors of the step alone.
  bool factors_last() const { return no_settle_ && !metric_.local() && factored_ && rows_.whole(); }

  // After load(): moves with the factors at hand, none of them longer than `longest`. Another
  // status than success: they leave more than `may_be_left`.
  Move chord_moves(const Candidate& candidate, double longest, double may_be_left) {
    constexpr int kMostMoves = 3;
    Move result;
    double previous = 0.0;
    while (result.moves < kMostMoves && value(candidate.t) == Status::success) {
      const double length = solve(candidate.weights);
      if (!(length <= longest)) break;
      if (result.moves == 0) {
        result.length = length;
        result.drift_before = drift();
      } else {
        wear_.looked(length / previous);
      }
      apply(candidate);
      ++result.moves;
      const bool look = result.moves == 1 && wear_.must_look(length, may_be_left);
      if (length <= 0.0 || (!look && wear_.rate() * length <= may_be_left)) {
        result.status = Status::success;
        break;
      }
      if (wear_.rate() > FactorWear::kWornOut) break;
      previous = length;
    }
    return result;
  }

  // The whole move dy.
  void apply(const Candidate& candidate) {
    N_VLinearSum(1.0, candidate.correction, -1.0, dy_, candidate.correction);
    N_VLinearSum(1.0, y_, -1.0, dy_, y_);
  }

  Move newton(const Candidate& candidate) {
    Move result;
    load(candidate);
    if ((result.status = value(candidate.t)) != Status::success) return result;
    metric_.set(candidate, dy_);
    result.drift_before = result.drift_after = drift();
    monitor_.start();
    bool have_factors = false, fresh = false;
    for (;;) {
      if (!have_factors) {
        if ((result.status = factor(candidate)) != Status::success) return result;
        have_factors = fresh = true;
      }
      const double length = solve(candidate.weights);
      if (++result.moves == 1) {
        result.length = length;
        const double limit =
            length <= options_.advanced.largest_move
                ? options_.advanced.largest_move
                : options_.advanced.largest_move *
                      std::max(1.0, N_VWrmsNorm(candidate.correction, candidate.weights));
        if (!(length <= limit)) {
          if (options_.advanced.long_move == LongMove::reject || !std::isfinite(length)) {
            result.status = std::isfinite(length) ? Status::move_too_long : Status::not_finite;
            message_ = "the move onto the constraints is " + brief(length) +
                       " tolerances long, the limit is " + brief(limit) +
                       " (Options::largest_move)";
            return result;
          }
          N_VLinearSum(1.0, candidate.correction, -limit / length, dy_, candidate.correction);
          result.left = length - limit;
          result.length = limit;
          result.capped = true;
          result.status = Status::success;
          return result;
        }
      }
      apply(candidate);
      const double floor = std::min(0.1, 1e3 * kEpsilon * N_VWrmsNorm(y_, candidate.weights));
      const Monitor::Verdict verdict = monitor_.judge(length, fresh, floor);
      const double left = rows_.left() * length;  // by a solution that is not exact
      if (verdict == Monitor::Verdict::done && left <= options_.advanced.tolerance) break;
      if (verdict == Monitor::Verdict::failed ||
          result.moves >= options_.advanced.maximum_iterations) {
        result.status = Status::not_converged;
        message_ = "move " + std::to_string(result.moves) + " onto the constraints still is " +
                   brief(length) + " tolerances long; check C";
        return result;
      }
      if ((result.status = value(candidate.t)) != Status::success) return result;
      result.drift_after = drift();
      fresh = false;
      have_factors = verdict != Monitor::Verdict::refactor;
    }
    result.status = contradicts() ? Status::inconsistent : Status::success;
    return result;
  }

  void free_all() {
    holds_algebraic_ = false;
    metric_.free_all();
  }

  // y = base + correction, s <- max(0.8 s, |correction|).
  void load(const Candidate& candidate) {
    N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
    metric_.look(candidate, work_, dy_);
  }

  // The rows' own message where they do not succeed.
  Status told(Status status) {
    if (status == Status::success) return status;
    message_ = rows_.report.text;
    fatal_ |= rows_.report.fatal;
    return status;
  }

  Status value(double t) { return fatal_ ? Status::callback_fatal : told(rows_.value(t, y_)); }

  Status factor(const Candidate& candidate, N_Vector terms_at = nullptr) {
    factored_ = false;
    if (fatal_) return Status::callback_fatal;
    Status status = told(rows_.fill(candidate.t, y_));
    if (status != Status::success) return status;
    if (holds_algebraic_ && rows_.contains_algebraic(id_)) {
      free_all();
      metric_.set(candidate, dy_);
    }
    if ((status = told(rows_.factor(metric_, terms_at))) != Status::success) return status;
    factored_ = true;
    wear_.renewed();
    return Status::success;
  }

  // Returns the WRMS length of dy in the error norm.
  double solve(N_Vector weights) {
    ++statistics_.iterations;
    rows_.solve(metric_.D(), dy_);
    return N_VWrmsNorm(dy_, weights);
  }

  bool contradicts() {
    if (!rows_.contradict(dy_)) return false;
    contradicting_rows_ = rows_.report.rows;
    message_ = rows_.report.text;
    return true;
  }

  double drift() const { return rows_.drift(); }

  const Options& options_;
  Statistics& statistics_;
  Monitor monitor_;
  OwnedVector y_, dy_, work_;
  VectorMetric metric_;
  Rows rows_;
  FactorWear wear_;
  bool factored_ = false;
  bool no_settle_ = false;
  N_Vector id_ = nullptr;         // the caller's of set_algebraic()
  bool holds_algebraic_ = false;  // no row has contained one so far
};

}  // namespace tether::ida_projection
