// Tether: g, C and its factors at a candidate, through N_Vectors alone. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "host/owned_vector.hpp"
#include "movers/newton.hpp"
#include "movers/vector/vector_metric.hpp"

namespace tether::ida_projection {

/// Rows on any N_Vector. `Store` keeps g, C and the factors of C D:
///
///     Status value(t, y), fill(t, y), factor(metric, terms_at), all counted in the statistics;
///                                 `terms_at`: y for rounding_only(), or null
///     double drift()              largest |g_i|
///     double solve(D, dy)         the shortest D^-1 dy with C dy = g; what is left of it
///     bool contains_algebraic(id), whole(), rounding_only()
///     bool contradict(dy)         after solve()
///
/// and reports where it is told to. Vectors may be spread over processes: all of these have the
/// same outcome on every one.
template <class Store>
class VectorRows : public Newton<VectorRows<Store>> {
  using Base = Newton<VectorRows<Store>>;
  using Factors = RowsAt::Factors;

 public:
  using RowsAt::drift;
  using RowsAt::factors;
  using RowsAt::report;

  VectorRows(const Constraints& constraints, const Options& options, Statistics& statistics,
             N_Vector like)
      : Base(RowsAt::Kind::vectors, options, statistics),
        metric_(options, like),
        rows_(constraints, statistics, like, report),
        y_(like),
        dy_(like),
        work_(like) {
    free_all();
    forget();
  }

  Status load(const Candidate& candidate, bool) override {
    at_ = candidate;
    follow(candidate, nullptr);
    metric_.update_scale(candidate, work_, dy_);
    return Status::success;
  }
  Status value(double t, bool) override {
    if (report.fatal) return Status::callback_fatal;
    const Status status = rows_.value(t, y_);
    drift = rows_.drift();
    return status;
  }
  Status factor(double t, bool refill) override {
    if (refill) metric_.set(at_, dy_);
    factors = Factors::none;
    if (report.fatal) return Status::callback_fatal;
    Status status = rows_.fill(t, y_);
    if (status != Status::success) return status;
    if (holds_algebraic_ && rows_.contains_algebraic(id_)) {
      free_all();
      metric_.set(at_, dy_);
    }
    status = rows_.factor(metric_, moves_ ? nullptr : static_cast<N_Vector>(y_));
    if (status == Status::success)
      factors = rows_.whole() ? Factors::of_all_rows : Factors::of_some_rows;
    return status;
  }
  Solution solve(Solve how) override {
    if (how != Solve::test) ++Base::statistics_.iterations;
    Solution found;
    found.left = rows_.solve(metric_.D(), dy_);
    found.length = N_VWrmsNorm(dy_, at_.weights);
    return found;
  }
  Status apply(double share, const Candidate& candidate) override {
    N_VLinearSum(1.0, candidate.correction, -share, dy_, candidate.correction);
    N_VLinearSum(1.0, y_, -share, dy_, y_);
    return Status::success;
  }
  bool is_rounding() override { return rows_.rounding_only(); }

  double follow(const Candidate& candidate, N_Vector change) override {
    if (change == nullptr) {
      N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
      return 0.0;
    }
    N_VLinearSum(1.0, y_, 1.0, change, y_);
    return N_VWrmsNorm(change, at_.weights);
  }
  double corrected() const override { return N_VWrmsNorm(at_.correction, at_.weights); }
  bool contradicts() override { return rows_.contradict(dy_); }

  // Algebraic components are held as long as no row contains them.
  Status set_algebraic(const Candidate& candidate, N_Vector id,
                       const std::vector<char>& /*repeats*/) override {
    id_ = id;
    moves_ = true;
    free_all();
    if (id == nullptr) return Status::success;
    (void)load(candidate, true);
    if (report.fatal) return Status::callback_fatal;
    const Status status = rows_.fill(candidate.t, y_);
    if (status != Status::success) return status;
    factors = Factors::none;
    holds_algebraic_ = !rows_.contains_algebraic(id);
    if (holds_algebraic_) metric_.hold_all_but(id);
    return Status::success;
  }
  void accept() override { metric_.accept(); }
  void forget() {
    metric_.reset();
    factors = Factors::none;
    moves_ = false;
  }

 protected:
  VectorMetric metric_;
  Store rows_;

 private:
  void free_all() {
    holds_algebraic_ = false;
    metric_.free_all();
  }

  Candidate at_{};
  OwnedVector y_, dy_, work_;
  bool moves_ = false;            // have begun in this run
  bool holds_algebraic_ = false;  // no row has contained one so far
  N_Vector id_ = nullptr;         // the caller's of set_algebraic()
};

}  // namespace tether::ida_projection
