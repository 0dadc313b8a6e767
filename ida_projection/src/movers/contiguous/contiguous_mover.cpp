// Tether: Newton's method onto the constraints, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "contiguous_mover.hpp"

#include "attach/shortest.hpp"
#include "host/mechanisms.hpp"

namespace tether::ida_projection {

namespace {

// Factors of an earlier step leave at most so much for settle(), in tolerances.
constexpr double kForLater = 0.1;
constexpr double kTurned = 4.0;  // by so much C of an earlier look may mislead
constexpr int kLooks = 16;       // looks with the factors of one
constexpr int kQuiet = 8;        // moves that were none, then looks begin again
constexpr int kQuick = 3;        // moves with a whole C

}  // namespace

template <class Rows>
Status ContiguousMover<Rows>::set_algebraic(const Candidate& candidate, N_Vector id) {
  rows_.at.load(candidate);
  const double* mask = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
  return rows_.structure(candidate, mask);
}

template <class Rows>
bool ContiguousMover<Rows>::must_learn(double length) const {
  if constexpr (Rows::kThinRows)
    return rows_.factors.thin && start_known_ && rows_.blocks.trust.must_learn(length);
  return false;
}

template <class Rows>
bool ContiguousMover<Rows>::contradicts() {
  if (!rows_.contradicts()) return false;
  contradicting_rows_ = rows_.blocks.contradiction.rows;
  return true;
}

// Do C and the factors of an earlier look show that there is nothing to do? A run whose constraints
// IDA keeps by itself looks at every step and finds rounding: g alone tells, while what its factors
// make of it is far below the length at which moves begin.
template <class Rows>
bool ContiguousMover<Rows>::plainly_nothing() {
  if (!in_use(Mechanism::looks)) return false;
  const FactorState& factors = rows_.factors;
  if (!factors.there || factors.thin || rows_.blocks.dropped_rows() || looks_ >= kLooks)
    return false;
  ++looks_;
  ++kept_.age;
  return rows_.rounding_only() || kTurned * rows_.look() <= kNothing;
}

template <class Rows>
Move ContiguousMover<Rows>::measure(const Candidate& candidate) {
  Move result;
  rows_.at.load(candidate);
  if (!rows_.blocks.structured()) {
    result.status = rows_.structure(candidate, nullptr);
    if (result.status != Status::success) return result;
  }
  const bool may_do = rows_.factors.there && looks_ < kLooks;  // with g alone
  result.status = may_do ? rows_.value(candidate.t) : rows_.value_with_rows(candidate.t);
  if (result.status != Status::success) return result;
  result.drift_before = result.drift_after = rows_.drift();
  if (result.drift_before == 0.0 || plainly_nothing()) return result;
  looks_ = 0;
  rows_.set_metric(true);
  rows_.factors.decided = false;
  if ((result.status = factor(candidate.t)) != Status::success) return result;
  if (rows_.rounding_only()) return result;
  result.length = first_solve();
  // That there is nothing to do the rows that an earlier look has kept tell as well.
  const bool nothing = result.length <= kNothing && rows_.dropped_follow();
  if (!rows_.factors.decided && !nothing) {
    rows_.factors.lasting = false;
    if ((result.status = factor(candidate.t)) != Status::success) return result;
    result.length = first_solve();
  }
  result.floor = 4.0 * kEpsilon * rows_.at.size();
  if (contradicts()) result.status = Status::inconsistent;
  return result;
}

// Only a long move can be too long: the limit is at least largest_move.
template <class Rows>
bool ContiguousMover<Rows>::too_long(double length, double& limit) const {
  if (length <= options_.advanced.largest_move) return false;
  double sum = 0.0;
  rows_.blocks.d.for_columns([&](int, int j) {
    const double change = rows_.at.ycor[j] * rows_.at.w[j];
    sum += change * change;
  });
  limit = options_.advanced.largest_move * std::max(1.0, rows_.wrms(sum));
  return !(length <= limit);
}

// The same where moves have begun, after some that were none: rows that F contains, or that IDA
// keeps by itself between the steps that need them.
template <class Rows>
bool ContiguousMover<Rows>::still_nothing(const Candidate& candidate, Move& result) {
  if (!in_use(Mechanism::looks) || nothing_in_row_ < kQuiet) return false;
  result.status = rows_.value(candidate.t);
  if (result.status != Status::success) return true;
  result.looked = still_ = plainly_nothing();
  if (!still_) return false;
  result.drift_before = result.drift_after = rows_.drift();
  rows_.set_metric(false);
  move_length_ = 0.0;
  reused_ = false;
  return true;
}

template <class Rows>
Move ContiguousMover<Rows>::move(const Candidate& candidate) {
  Move result;
  rows_.at.load(candidate);
  still_ = false;
  by_present_factors_ = -1.0;
  if (still_nothing(candidate, result)) return result;
  reused_ = keeps_factors() && rows_.factors.there;
  ++kept_.age;
  rows_.factors.decided = false;
  result.status = reused_ ? rows_.value(candidate.t) : rows_.value_with_rows(candidate.t);
  if (result.status != Status::success) return result;
  start_known_ = false;
  looks_ = 0;
  if (quick_move(candidate, result)) return result;
  const bool nothing = result.status == Status::success && result.length <= kNothing;
  nothing_in_row_ = nothing && !keeps_factors() ? nothing_in_row_ + 1 : 0;
  const bool broken =
      result.status == Status::not_converged || result.status == Status::move_too_long;
  if (broken || result.moves > kQuick) rows_.blocks.look_again_soon();
  // Kept factors are in use only while dropped rows ask for less than that.
  if (rows_.blocks.dropped_rows() && result.status == Status::success && !result.capped &&
      !reused_ && contradicts())
    result.status = Status::inconsistent;
  return result;
}

// The usual move of few rows: independent as before, and short enough to be the only one. False:
// it was made as a whole, whatever it took.
template <class Rows>
bool ContiguousMover<Rows>::quick_move(const Candidate& candidate, Move& result) {
  const double drift = rows_.drift();
  result.drift_before = result.drift_after = drift;
  bool solved = false;
  double length = 0.0;
  if (in_use(Mechanism::one_pass_move) && !reused_) {
    result.status = rows_.quick_solve(candidate.t, solved, length);
    if (result.status != Status::success) return true;
  }
  if (!solved) {
    rows_.set_metric(!reused_);
    result = newton(candidate, drift);
    return false;
  }
  kept_ = {kUnknownSlope, 0};
  monitor_.start();
  if (!(length <= options_.advanced.largest_move) || !monitor_.plainly_done(length)) {
    result = newton(candidate, drift, &length);
    return false;
  }
  rows_.apply(1.0, candidate.correction_entries);
  result.moves = 1;
  result.length = move_length_ = length;
  result.status = Status::success;
  nothing_in_row_ = length <= kNothing ? nothing_in_row_ + 1 : 0;
  return true;
}

// Back to the correction before the move.
template <class Rows>
void ContiguousMover<Rows>::restart(const Candidate& candidate) {
  for (std::size_t i = 0; i < start_.size(); ++i) candidate.correction_entries[i] = start_[i];
  rows_.at.restart(candidate);
}

// Newton's method from rows_.at.y, with g_ known there. `first`: the length of the first move is
// known, too, from fresh factors of independent rows.
template <class Rows>
Move ContiguousMover<Rows>::newton(const Candidate& candidate, double drift_before,
                                   const double* first) {
  Move result;
  double* correction = candidate.correction_entries;
  result.drift_before = result.drift_after = drift_before;

  if (first == nullptr) monitor_.start();
  bool fresh = first != nullptr;  // factors belong to the present y
  bool have_factors = reused_ || fresh;
  const bool was_reused = reused_;
  if (Rows::kThinRows && was_reused)
    std::copy(correction, correction + start_.size(), start_.begin());
  bool tried = false;
  for (;;) {
    if (!have_factors) {
      if ((result.status = factor(candidate.t)) != Status::success) return result;
      have_factors = fresh = true;
      if (result.moves == 0 || was_reused) {
        start_known_ = rows_.factors.thin;
        if (rows_.factors.thin && !was_reused)
          std::copy(correction, correction + start_.size(), start_.begin());
      }
    }
    const double length = first != nullptr ? *first : fresh ? first_solve() : rows_.solve();
    first = nullptr;
    if (result.moves == 0 && !tried && must_learn(length)) {
      // The firm rows' move shows how C turns; then all rows are judged, from the start.
      tried = true;
      rows_.apply(1.0, correction);
      if ((result.status = rows_.learn_trust(candidate.t, length)) != Status::success)
        return result;
      restart(candidate);
      have_factors = false;
      continue;
    }
    const bool follow = !rows_.blocks.dropped_rows() || rows_.dropped_follow();
    if (reused_ && !(length <= kLong && follow)) {
      rows_.set_metric(true);
      reused_ = have_factors = false;
      continue;
    }
    if (!follow && Rows::kKeepsRank) {
      rows_.factors.lasting = have_factors = false;
      continue;
    }
    ++result.moves;

    if (result.moves == 1) {
      result.length = move_length_ = length;
      double limit = 0.0;
      if (!std::isfinite(length) || too_long(length, limit)) {
        if (options_.advanced.long_move == LongMove::reject || !std::isfinite(length)) {
          result.status = std::isfinite(length) ? Status::move_too_long : Status::not_finite;
          message_ = "the move onto the constraints is " + brief(length) +
                     " tolerances long, the limit is " + brief(limit) +
                     " (Options::largest_move); start closer with make_consistent, or use a "
                     "smaller step";
          return result;
        }
        rows_.apply(limit / length, correction);
        result.left = length - limit;
        result.length = limit;
        result.capped = true;
        result.status = Status::success;
        return result;
      }
    }
    rows_.apply(1.0, correction);
    by_present_factors_ = length;
    if (reused_) {
      if (2.0 * kept_.rate() * length <= kForLater) break;
      if ((result.status = rows_.value(candidate.t)) != Status::success) return result;
      rows_.set_metric(true);
      reused_ = have_factors = false;
      continue;
    }
    if (result.moves == 1 && rows_.factors.thin &&
        (result.status = rows_.learn_trust(candidate.t, length)) != Status::success)
      return result;

    if (result.moves == 1 && monitor_.plainly_done(length)) break;
    // A first move longer than the largest floor need not know it.
    const double floor = result.moves == 1 && length > kLargestFloor
                             ? 0.0
                             : std::min(kLargestFloor, 1e3 * kEpsilon * rows_.at.size());
    Monitor::Verdict verdict = monitor_.judge(length, fresh, floor);
    // Almost parallel rows magnify rounding: a move that it explains has converged.
    if ((verdict == Monitor::Verdict::failed || verdict == Monitor::Verdict::refactor) &&
        length <= std::min(kLargestFloor, rows_.rounding_length()))
      verdict = Monitor::Verdict::done;
    // One that answers nothing but rounding of g leads nowhere, however long it is.
    if (verdict == Monitor::Verdict::failed && rows_.rounding_only()) {
      rows_.apply(-1.0, correction);
      by_present_factors_ = -1.0;
      break;
    }
    if (verdict == Monitor::Verdict::done) break;
    if (verdict == Monitor::Verdict::failed) {
      result.status = Status::not_converged;
      message_ =
          "move " + std::to_string(result.moves) + " onto the constraints still is " +
          brief(length) +
          " tolerances long; check the constraint Jacobian with check_jacobian, or whether "
          "the rows have a common solution here; rows written as squares have none but double "
          "roots, and rows with |.| or max no derivative: neither lets Newton's moves shrink";
      return result;
    }
    if ((result.status = rows_.value(candidate.t)) != Status::success) return result;
    result.drift_after = rows_.drift();
    fresh = false;
    have_factors = verdict != Monitor::Verdict::refactor;
  }

  result.status = Status::success;
  return result;
}

template <class Rows>
bool ContiguousMover<Rows>::solve_with_factors(const std::vector<double>& g,
                                               std::vector<double>& dy) {
  if (g.size() != static_cast<std::size_t>(rows_.count())) return false;
  Rows& blocks = rows_.blocks;
  blocks.solve_roughly(g);
  std::fill(dy.begin(), dy.end(), 0.0);
  for (const auto* block : {&blocks.d, &blocks.a})
    if (!block->rows.empty())
      block->for_columns([&dy, from = block->dy.data()](int k, int i) {
        dy[static_cast<std::size_t>(i)] = from[k];
      });
  return true;
}

std::unique_ptr<Mover> make_dense_mover(const Constraints& constraints, const Options& options,
                                        Statistics& statistics, int size, int reported) {
  return std::make_unique<ContiguousMover<DenseRows>>(constraints, options, statistics, size,
                                                      reported);
}

std::unique_ptr<Mover> make_sparse_mover(const Constraints& constraints, const Options& options,
                                         Statistics& statistics, int size, int reported) {
  return std::make_unique<ContiguousMover<SparseRows>>(constraints, options, statistics, size,
                                                       reported);
}

}  // namespace tether::ida_projection
