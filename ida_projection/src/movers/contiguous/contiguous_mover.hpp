// Tether: the move onto the constraints on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
//
// Notation as in docs/method/projection.md: N unknowns, m rows, C = dg/dy, D the metric, WT = 1/w
// the error weights, s the size of the corrector's changes. The move itself is in
// contiguous_mover.cpp, its metric in local_metric.hpp, what follows the polish in
// contiguous_settle.cpp; their common data is here.
#pragma once

#include "factored_rows.hpp"
#include "host/mechanisms.hpp"
#include "movers/factor_wear.hpp"
#include "movers/mover.hpp"

namespace tether::ida_projection {

constexpr double kLargestFloor = 0.1;  // tolerances
// A move leaves this part where nothing is known yet.
constexpr double kUnknownSlope = 0.03;
constexpr double kLong = 1.0;      // tolerances: such a move is made with fresh factors
constexpr double kNothing = 1e-8;  // tolerances: as good as no move

/// Factors of an earlier step leave the part slope * age of a move, age in candidates.
struct SlopeOfFactors {
  double slope = 0.0;
  int age = 0;
  double rate() const { return slope * age; }
};

/// `Rows` keeps C and its factors: DenseRows (dense) or SparseRows.
template <class Rows>
class ContiguousMover final : public Mover {
 public:
  ContiguousMover(const Constraints& constraints, const Options& options, Statistics& statistics,
                  int size, int reported)
      : options_(options),
        monitor_(options),
        rows_(constraints, options, statistics, size, reported, message_),
        takes_rest_(Rows::many(rows_.count())),
        start_(static_cast<std::size_t>(size), 0.0) {}

  Move measure(const Candidate& candidate) override;
  Move move(const Candidate& candidate) override;
  int rank_of_factors() const override {
    const FactorState& at_hand = rows_.factors;
    const bool serve = at_hand.there && !at_hand.thin && !at_hand.partial && !at_hand.foreign;
    return serve ? rows_.blocks.rank() : -1;
  }
  double left_of_dropped(const std::vector<double>& WT) override {
    return rows_.blocks.dropped_rows() ? rows_.blocks.left_of_dropped(WT) : 0.0;
  }
  void rows_changed() override { rows_.factors.foreign = true; }
  bool solve_with_factors(const std::vector<double>& g, std::vector<double>& dy) override;
  Status set_algebraic(const Candidate& candidate, N_Vector id) override;
  Status settle(const Candidate& candidate, N_Vector change) override;
  double remaining_drift(const Candidate& candidate) override {
    rows_.at.restart(candidate);
    return rows_.value(candidate.t) == Status::success ? rows_.drift() : -1.0;
  }
  bool tangency(const std::vector<double>& yp, const double* id, Tangency& out) override;
  void accept() override { rows_.metric.accept(); }
  bool metric(N_Vector D) const override {
    if (rows_.at.w == nullptr) return false;
    rows_.metric.current(rows_.at, N_VGetArrayPointer(D));
    return true;
  }
  // Few rows make no rough moves. Where rows are about to depend on each other, at dead points, F
  // answers to any move, stiff or not.
  bool may_use_levels() const override {
    return rows_.count() > kFewForLevels && !rows_.factors.thin && !rows_.blocks.dropped_rows();
  }
  bool use_levels(bool on) override {
    if (on && !rows_.find_levels()) return false;
    if (!on) rows_.metric.forget_levels();
    rows_.factors.there = false;
    return true;
  }
  bool fatal() const override { return rows_.evaluator.fatal(); }
  void forget_failure() override { rows_.evaluator.forget(); }
  // Old factors leave more of what dropped rows ask for.
  bool may_polish_first() const override {
    return Rows::kKeepsFactors ? !rows_.blocks.dropped_rows() : takes_rest_;
  }
  Status finish(const Candidate& candidate, bool polished) override {
    if (still_) return Status::success;
    // Newton's method goes on where a move costs little beside the step.
    if (takes_rest_) return take_rest(candidate, move_length_);
    if (!keeps_factors()) return Status::success;
    const bool unseen =
        move_length_ > kSafe * options_.advanced.tolerance || !rows_.dropped_follow();
    return unseen ? take_back(candidate, polished ? by_present_factors_ : -1.0) : Status::success;
  }
  void reset() override {
    rows_.reset();
    monitor_.reset();
    staleness_.reset();
    nothing_in_row_ = 0;
    still_ = false;
    move_length_ = 0.0;
  }

 private:
  bool keeps_factors() const {
    return in_use(Mechanism::kept_factors) && Rows::kKeepsFactors && rows_.factors.lasting;
  }
  Status take_back(const Candidate& candidate, double previous);
  Status take_rest(const Candidate& candidate, double reach);
  Status factor(double t) {
    const Status status = rows_.factor(t);
    if (status == Status::success) kept_ = {kUnknownSlope, 0};
    return status;
  }
  double first_solve() { return rows_.first_solve(); }
  bool contradicts();
  bool plainly_nothing();
  bool still_nothing(const Candidate& candidate, Move& result);
  bool must_learn(double length) const;
  void restart(const Candidate& candidate);
  bool quick_move(const Candidate& candidate, Move& result);
  Move newton(const Candidate& candidate, double drift_before, const double* first = nullptr);
  bool too_long(double length, double& limit) const;

  const Options& options_;
  Monitor monitor_;
  FactoredRows<Rows> rows_;
  bool takes_rest_;            // that Newton's method leaves
  std::vector<double> start_;  // the correction before the move, kept where there are thin rows
  bool start_known_ = false;
  double move_length_ = 0.0;  // of the last first move, in tolerances
  // Length of the last move, if the factors at hand made it; < 0: others did.
  double by_present_factors_ = -1.0;
  bool reused_ = false;     // factors of an earlier step are in use for this one
  SlopeOfFactors kept_;     // these
  int looks_ = 0;           // with the factors of an earlier candidate
  int nothing_in_row_ = 0;  // moves that were none
  bool still_ = false;      // the last candidate was only looked at
  Staleness staleness_;
};

}  // namespace tether::ida_projection
