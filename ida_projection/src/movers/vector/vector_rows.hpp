// Tether: g, C and its factors at a candidate, through N_Vectors alone. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "movers/vector/vector_metric.hpp"

namespace tether::ida_projection {

/// Rows on any N_Vector. `Store` keeps g, C and the factors of C D:
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
template <class Store>
class VectorRows final : public RowsAt {
 public:
  VectorRows(const Constraints& constraints, const Options& options, Statistics& statistics,
             N_Vector like)
      : statistics_(statistics),
        y_(like),
        dy_(like),
        work_(like),
        metric_(options, like),
        rows_(constraints, statistics, like) {
    free_all();
    reset();
  }

  Status load(const Candidate& candidate, bool) override {
    at_ = candidate;
    restart(candidate);
    metric_.update_scale(candidate, work_, dy_);
    return Status::success;
  }
  Status value(double t, bool) override {
    return fatal_ ? Status::callback_fatal : with_message(rows_.value(t, y_));
  }
  Status factor(double t, bool refill) override {
    if (refill) metric_.set(at_, dy_);
    factored_ = false;
    if (fatal_) return Status::callback_fatal;
    Status status = with_message(rows_.fill(t, y_));
    if (status != Status::success) return status;
    if (holds_algebraic_ && rows_.contains_algebraic(id_)) {
      free_all();
      metric_.set(at_, dy_);
    }
    status = with_message(rows_.factor(metric_, moves_ ? nullptr : static_cast<N_Vector>(y_)));
    factored_ = status == Status::success;
    return status;
  }
  Solution solve(Solve how) override {
    if (how != Solve::test) ++statistics_.iterations;
    rows_.solve(metric_.D(), dy_);
    Solution found;
    found.length = N_VWrmsNorm(dy_, at_.weights);
    found.left = rows_.left();
    return found;
  }
  Status apply(double share, const Candidate& candidate) override {
    N_VLinearSum(1.0, candidate.correction, -share, dy_, candidate.correction);
    N_VLinearSum(1.0, y_, -share, dy_, y_);
    return Status::success;
  }
  double size() const override { return N_VWrmsNorm(y_, at_.weights); }
  double change() const override { return N_VWrmsNorm(at_.correction, at_.weights); }
  bool rounding_only() override { return rows_.rounding_only(); }

  double shift(N_Vector change) override {
    N_VLinearSum(1.0, y_, 1.0, change, y_);
    return N_VWrmsNorm(change, at_.weights);
  }
  void restart(const Candidate& candidate) override {
    N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
  }
  double drift() const override { return rows_.drift(); }
  bool may_test_with_factors() const override { return factored_ && rows_.whole(); }
  bool contradicts() override {
    if (!rows_.contradict(dy_)) return false;
    contradicting = rows_.report.rows;
    message = rows_.report.text;
    return true;
  }

  // Algebraic components are held as long as no row contains them.
  Status set_algebraic(const Candidate& candidate, N_Vector id) override {
    id_ = id;
    moves_ = true;
    free_all();
    if (id == nullptr) return Status::success;
    (void)load(candidate, true);
    if (fatal_) return Status::callback_fatal;
    const Status status = with_message(rows_.fill(candidate.t, y_));
    if (status != Status::success) return status;
    factored_ = false;
    holds_algebraic_ = !rows_.contains_algebraic(id);
    if (holds_algebraic_) metric_.hold_all_but(id);
    return Status::success;
  }
  bool metric(N_Vector D) const override {
    N_VScale(1.0, metric_.D(), D);
    return factored_;
  }
  void accept() override { metric_.accept(); }
  void reset() override {
    metric_.reset();
    factored_ = moves_ = false;
  }
  bool fatal() const override { return fatal_; }
  void forget_failure() override { fatal_ = false; }

 private:
  void free_all() {
    holds_algebraic_ = false;
    metric_.free_all();
  }
  // The rows' own message where they do not succeed.
  Status with_message(Status status) {
    if (status == Status::success) return status;
    message = rows_.report.text;
    fatal_ |= rows_.report.fatal;
    return status;
  }

  Statistics& statistics_;
  Candidate at_{};
  OwnedVector y_, dy_, work_;
  VectorMetric metric_;
  Store rows_;
  bool factored_ = false, fatal_ = false;
  bool moves_ = false;            // have begun in this run
  N_Vector id_ = nullptr;         // the caller's of set_algebraic()
  bool holds_algebraic_ = false;  // no row has contained one so far
};

}  // namespace tether::ida_projection
