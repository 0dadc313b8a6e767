// Tether: the move onto few constraints on any N_Vector. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "host/owned_vector.hpp"
#include "movers/factor_wear.hpp"
#include "movers/vector_metric.hpp"
#include "rows/gradient_rows.hpp"
#include "rows/rounding.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kNoMove = 1e-9;  // tolerances: no move at all

class GradientMover final : public Mover {
 public:
  GradientMover(const Constraints& constraints, const Options& options, Statistics& statistics,
                N_Vector like)
      : options_(options),
        statistics_(statistics),
        constraints_(constraints),
        monitor_(options),
        y_(like),
        dy_(like),
        work_(like),
        metric_(options, like),
        rows_(constraints.total_count(), like),
        g_(static_cast<std::size_t>(rows_.rows()), 0.0),
        terms_(g_) {
    flatten(constraints, 0);
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
    const Status status = fill(candidate.t);
    if (status != Status::success) return status;
    holds_algebraic_ = !contains_algebraic();
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
    sums_terms_ = static_cast<N_Vector>(y_)->ops->nvl1norm != nullptr;
    result.status = factor(candidate);
    sums_terms_ = false;
    if (result.status != Status::success) return result;
    if (rounding_only()) return result;
    result.length = solve(candidate.weights);
    result.floor = 4.0 * kEpsilon * N_VWrmsNorm(y_, candidate.weights);
    if (contradicts()) result.status = Status::inconsistent;
    return result;
  }

  bool may_follow() override { return factored_ && wear_.usable(); }
  Move follow(const Candidate& candidate, bool again) override {
    if (again)
      N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
    else
      load(candidate);
    return chord_moves(candidate, 1e2 * kEpsilon * N_VWrmsNorm(y_, candidate.weights),
                       options_.largest_move, kMayFollowLeave);
  }

  // A short move by factors of an earlier step leaves a part of itself that their age tells; where
  // that is too much Newton's method goes on from where it ends.
  Move move(const Candidate& candidate) override {
    constexpr double kShort = 0.1, kSafe = 0.25;
    Move result;
    if (factors_last() && wear_.usable()) {
      load(candidate);
      result = chord_moves(candidate, 0.0, kShort, kSafe * options_.tolerance);
      if (result.status == Status::success || fatal_) return result;
    }
    const double moved = result.length;
    result = newton(candidate);
    result.length += moved;
    return result;
  }

 private:
  struct Part {
    const Gradients* rows;
    int first;
  };

  // Error weights change slowly, and so do factors in their metric. What follows a polish is taken
  // back with the factors of the step alone.
  bool factors_last() const {
    return no_settle_ && !metric_.local() && factored_ && rows_.rank() == rows_.rows();
  }

  // After load(): moves with the factors at hand.
  Move chord_moves(const Candidate& candidate, double floor, double longest, double may_be_left) {
    return move_with_old_factors(
        wear_, [&] { return value(candidate.t); }, [&] { return solve(candidate.weights); },
        [&] { apply(candidate); }, [&] { return drift(); }, floor, longest, may_be_left);
  }

  // The whole move dy.
  void apply(const Candidate& candidate) {
    N_VLinearSum(1.0, candidate.correction, -1.0, dy_, candidate.correction);
    N_VLinearSum(1.0, y_, -1.0, dy_, y_);
  }

  Move newton(const Candidate& candidate) {
    Move result;
    load(candidate);
    metric_.set(candidate, dy_);
    if ((result.status = value(candidate.t)) != Status::success) return result;
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
            length <= options_.largest_move
                ? options_.largest_move
                : options_.largest_move *
                      std::max(1.0, N_VWrmsNorm(candidate.correction, candidate.weights));
        if (!(length <= limit)) {
          if (options_.long_move == LongMove::reject || !std::isfinite(length)) {
            result.status = std::isfinite(length) ? Status::move_too_long : Status::not_finite;
            message_ = "the move onto the constraints is " + std::to_string(length) +
                       " tolerances long, the limit is " + std::to_string(limit) +
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
      if (verdict == Monitor::Verdict::done) break;
      if (verdict == Monitor::Verdict::failed) {
        result.status = Status::not_converged;
        message_ = "move " + std::to_string(result.moves) + " onto the constraints still is " +
                   std::to_string(length) + " tolerances long; check the gradients";
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

  // After fill().
  bool contains_algebraic() {
    for (N_Vector row : rows_.gradients()) {
      N_VProd(id_, row, work_);
      N_VLinearSum(1.0, row, -1.0, work_, work_);
      if (N_VMaxNorm(work_) > 0.0) return true;
    }
    return false;
  }

  // Returns the number of the row after those of the set.
  int flatten(const Constraints& set, int first) {
    if (set.count > 0) parts_.push_back({&std::get<Gradients>(set.jacobian), first});
    first += set.count;
    for (const Constraints& part : set.joined) first = flatten(part, first);
    return first;
  }

  // y = base + correction, s <- max(0.8 s, |correction|).
  void load(const Candidate& candidate) {
    N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
    metric_.look(candidate, work_, dy_);
  }

  Status failed(int flag, const char* what, const std::string& thrown) {
    message_ = std::string(what) +
               (thrown.empty() ? " returned " + std::to_string(flag) : " threw: " + thrown);
    if (flag < 0) fatal_ = true;
    return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
  }

  Status value(double t) {
    if (fatal_) return Status::callback_fatal;
    ++statistics_.value_evaluations;
    std::string thrown;
    for (const Part& part : parts_) {
      const int flag =
          guarded([&] { return part.rows->value(t, y_, g_.data() + part.first); }, thrown);
      if (flag != 0) return failed(flag, "Gradients::value", thrown);
    }
    for (int i = 0; i < rows_.rows(); ++i)
      if (!std::isfinite(g_[static_cast<std::size_t>(i)])) {
        message_ = "g of " + constraints_.name(i) + " is not finite";
        return Status::not_finite;
      }
    return Status::success;
  }

  Status fill(double t) {
    if (fatal_) return Status::callback_fatal;
    ++statistics_.jacobian_evaluations;
    std::string thrown;
    for (N_Vector row : rows_.gradients()) N_VConst(0.0, row);
    for (const Part& part : parts_) {
      const int flag = guarded(
          [&] { return part.rows->fill(t, y_, rows_.gradients().data() + part.first); }, thrown);
      if (flag != 0) return failed(flag, "Gradients::fill", thrown);
    }
    return Status::success;
  }

  Status factor(const Candidate& candidate) {
    factored_ = false;
    const Status status = fill(candidate.t);
    if (status != Status::success) return status;
    if (holds_algebraic_ && contains_algebraic()) {
      free_all();
      metric_.set(candidate, dy_);
    }
    ++statistics_.factorizations;
    if (sums_terms_)
      for (std::size_t i = 0; i < terms_.size(); ++i) {
        N_VProd(rows_.gradients()[i], y_, work_);
        terms_[i] = N_VL1Norm(work_);
      }
    const int bad = rows_.factor(metric_.D(), metric_.WT());
    if (bad >= 0) {
      message_ = "the gradient of " + constraints_.name(bad) + " is not finite";
      return Status::not_finite;
    }
    if (rows_.rank() < rows_.rows()) ++statistics_.rank_drops;
    factored_ = true;
    wear_.renewed();
    return Status::success;
  }

  // Returns the WRMS length of dy in the error norm.
  double solve(N_Vector weights) {
    ++statistics_.iterations;
    rows_.solve(g_, metric_.D(), dy_);
    return N_VWrmsNorm(dy_, weights);
  }

  bool contradicts() {
    std::vector<int> found = rows_.contradicting();
    if (found.empty()) return false;
    contradicting_rows_ = std::move(found);
    message_ = "rows contradict each other:";
    for (const int i : contradicting_rows_)
      message_ += " " + std::to_string(i) + " (" + constraints_.name(i) + ")";
    return true;
  }

  // Does the rounding of its own terms explain every g_i? It grows with the root of their number.
  bool rounding_only() const {
    const double unit = 64.0 * kEpsilon;
    for (std::size_t i = 0; i < g_.size(); ++i)
      if (!(std::abs(g_[i]) <= unit * terms_[i])) return false;
    return true;
  }

  double drift() const {
    double largest = 0.0;
    for (double g : g_) largest = std::max(largest, std::abs(g));
    return largest;
  }

  const Options& options_;
  Statistics& statistics_;
  const Constraints& constraints_;
  Monitor monitor_;
  std::vector<Part> parts_;
  OwnedVector y_, dy_, work_;
  VectorMetric metric_;
  GradientRows rows_;
  std::vector<double> g_;
  std::vector<double> terms_;  // sum_j |C_ij y_j|
  FactorWear wear_;            // for follow()
  bool factored_ = false;
  bool no_settle_ = false;
  N_Vector id_ = nullptr;         // the caller's of set_algebraic()
  bool holds_algebraic_ = false;  // no row has contained one so far
  bool sums_terms_ = false;       // measure() asks for them
};

}  // namespace

std::unique_ptr<Mover> make_gradient_mover(const Constraints& constraints, const Options& options,
                                           Statistics& statistics, N_Vector like) {
  return std::make_unique<GradientMover>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
