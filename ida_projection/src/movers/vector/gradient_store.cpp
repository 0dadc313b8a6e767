// Tether: storage of few rows given by their gradients, for VectorRows.
// SPDX-License-Identifier: BSD-3-Clause
#include "movers/vector/gradient_store.hpp"

#include <algorithm>
#include <cmath>

#include "host/rounding.hpp"
#include "movers/vector/vector_rows.hpp"
#include "rows/row_trust.hpp"

namespace tether::ida_projection {

GradientStore::GradientStore(const Constraints& constraints, Statistics& statistics, N_Vector like,
                             RowsReport& report)
    : rows(constraints.total_count(), like),
      g(static_cast<std::size_t>(rows.rows()), 0.0),
      constraints_(constraints),
      statistics_(statistics),
      report_(report),
      work_(like),
      terms_(g) {
  flatten(constraints, 0);
}

// Returns the number of the row after those of the set.
int GradientStore::flatten(const Constraints& set, int first) {
  if (set.count > 0) parts_.push_back({&std::get<Gradients>(set.jacobian), first, set.count});
  first += set.count;
  for (const Constraints& part : set.joined) first = flatten(part, first);
  return first;
}

Status GradientStore::value(double t, N_Vector y) {
  ++statistics_.value_evaluations;
  std::string thrown;
  for (const Part& part : parts_) {
    const auto write = [&] {
      return room_.written(g.data() + part.first, part.count, part.count,
                           [&](double* to) { return part.rows->value(t, y, to); });
    };
    const int flag = guarded(write, thrown);
    if (flag != 0) return report_.failed(flag, "Gradients::value", thrown, part.count);
  }
  for (int i = 0; i < rows.rows(); ++i)
    if (!std::isfinite(g[static_cast<std::size_t>(i)])) {
      report_.text = "g of " + constraints_.name(i) + " is not finite";
      return Status::not_finite;
    }
  return Status::success;
}

Status GradientStore::fill(double t, N_Vector y) {
  ++statistics_.jacobian_evaluations;
  std::string thrown;
  for (N_Vector row : rows.gradients()) N_VConst(0.0, row);
  for (const Part& part : parts_) {
    const int flag = guarded(
        [&] { return part.rows->fill(t, y, rows.gradients().data() + part.first); }, thrown);
    if (flag != 0) return report_.failed(flag, "Gradients::fill", thrown, part.count);
  }
  return Status::success;
}

bool GradientStore::contains_algebraic(N_Vector id) {
  for (N_Vector row : rows.gradients()) {
    N_VProd(id, row, work_);
    N_VLinearSum(1.0, row, -1.0, work_, work_);
    if (N_VMaxNorm(work_) > 0.0) return true;
  }
  return false;
}

void GradientStore::sum_terms(N_Vector y) {
  if (y->ops->nvl1norm == nullptr) return;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    N_VProd(rows.gradients()[i], y, work_);
    terms_[i] = N_VL1Norm(work_);
  }
}

Status GradientStore::factor(const VectorMetric& metric, N_Vector terms_at) {
  if (terms_at != nullptr) sum_terms(terms_at);
  return factor(metric.D(), metric.WT());
}

Status GradientStore::factor(N_Vector D, N_Vector WT) {
  ++statistics_.factorizations;
  const int bad = rows.factor(D, WT);
  if (bad >= 0) {
    report_.text = "the gradient of " + constraints_.name(bad) + " is not finite";
    return Status::not_finite;
  }
  if (!whole()) ++statistics_.rank_drops;
  return Status::success;
}

bool GradientStore::contradict(N_Vector) {
  std::vector<int> found = rows.contradicting();
  if (found.empty()) return false;
  report_.contradicting(std::move(found), constraints_);
  return true;
}

bool GradientStore::rounding_only() const {
  for (std::size_t i = 0; i < g.size(); ++i)
    if (!(std::abs(g[i]) <= kRoundingOfTerms * terms_[i])) return false;
  return true;
}

double GradientStore::drift() const {
  double largest = 0.0;
  for (double value : g) largest = std::max(largest, std::abs(value));
  return largest;
}

namespace {

/// Moves on the tangent, too.
class Gradient final : public VectorRows<GradientStore> {
 public:
  Gradient(const Constraints& constraints, const Options& options, Statistics& statistics,
           N_Vector like)
      : VectorRows(constraints, options, statistics, like), WT_(like), D_(like) {
    for (int i = 0; i < count(); ++i) C_.emplace_back(like);
  }

  int count() const override { return rows_.rows.rows(); }
  Status value_at(double t, N_Vector y, std::vector<double>& g) override {
    const Status status = rows_.value(t, y);
    g = rows_.g;
    return status;
  }
  // Algebraic components do not move where no row contains them.
  Status linearise(double t, N_Vector y, N_Vector weights, N_Vector id,
                   const std::vector<char>& /*repeats*/) override {
    const Status status = rows_.fill(t, y);
    if (status != Status::success) return status;
    for (std::size_t i = 0; i < C_.size(); ++i) N_VScale(1.0, rows_.rows.gradients()[i], C_[i]);
    N_VConst(0.0, WT_);
    (void)N_VInvTest(weights, WT_);
    held_ = id != nullptr && !rows_.contains_algebraic(id) ? id : nullptr;
    return status;
  }
  Status factor_in(N_Vector D) override {
    for (std::size_t i = 0; i < C_.size(); ++i) N_VScale(1.0, C_[i], rows_.rows.gradients()[i]);
    N_VScale(1.0, D, D_);
    if (held_ != nullptr) N_VProd(D, held_, D_);
    const Status status = rows_.factor(D_, WT_);
    rows_.rows.keep_firm(RowTrust::kThin);
    return status;
  }
  Status product(N_Vector s, std::vector<double>& r) override {
    for (std::size_t i = 0; i < C_.size(); ++i) r[i] = N_VDotProd(C_[i], s);
    return Status::success;
  }
  void solve_for(const std::vector<double>& r, N_Vector ds) override {
    rows_.rows.solve(r, D_, ds);
  }

 private:
  OwnedVector WT_, D_;
  N_Vector held_ = nullptr;
  std::vector<OwnedVector> C_;
};

}  // namespace

std::unique_ptr<RowsAt> make_gradient_rows(const Constraints& constraints, const Options& options,
                                           Statistics& statistics, N_Vector like) {
  return std::make_unique<Gradient>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
