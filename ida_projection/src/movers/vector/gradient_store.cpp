// Tether: storage of few rows given by their gradients, for VectorRows.
// SPDX-License-Identifier: BSD-3-Clause
#include "movers/vector/gradient_store.hpp"

#include <algorithm>
#include <cmath>

#include "host/rounding.hpp"
#include "movers/vector/vector_rows.hpp"

namespace tether::ida_projection {

GradientStore::GradientStore(const Constraints& constraints, Statistics& statistics, N_Vector like)
    : constraints_(constraints),
      statistics_(statistics),
      work_(like),
      rows_(constraints.total_count(), like),
      g_(static_cast<std::size_t>(rows_.rows()), 0.0),
      terms_(g_) {
  flatten(constraints, 0);
}

// Returns the number of the row after those of the set.
int GradientStore::flatten(const Constraints& set, int first) {
  if (set.count > 0) parts_.push_back({&std::get<Gradients>(set.jacobian), first, set.count});
  first += set.count;
  for (const Constraints& part : set.joined) first = flatten(part, first);
  return first;
}

Status GradientStore::failed(int flag, const char* what, const std::string& thrown) {
  report.text = std::string(what) +
                (thrown.empty() ? " returned " + std::to_string(flag) : " threw: " + thrown);
  if (flag < 0) report.fatal = true;
  return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
}

Status GradientStore::value(double t, N_Vector y) {
  ++statistics_.value_evaluations;
  std::string thrown;
  for (const Part& part : parts_) {
    double* const g = g_.data() + part.first;
    double* const to = room_.begin(part.count, part.count);
    std::copy_n(g, part.count, to);
    const int flag = guarded([&] { return part.rows->value(t, y, to); }, thrown);
    if (!room_.end(g, part.count))
      return failed(-1, "Gradients::value",
                    "it writes past its end: Constraints::count is " + std::to_string(part.count));
    if (flag != 0) return failed(flag, "Gradients::value", thrown);
  }
  for (int i = 0; i < rows_.rows(); ++i)
    if (!std::isfinite(g_[static_cast<std::size_t>(i)])) {
      report.text = "g of " + constraints_.name(i) + " is not finite";
      return Status::not_finite;
    }
  return Status::success;
}

Status GradientStore::fill(double t, N_Vector y) {
  ++statistics_.jacobian_evaluations;
  std::string thrown;
  for (N_Vector row : rows_.gradients()) N_VConst(0.0, row);
  for (const Part& part : parts_) {
    const int flag = guarded(
        [&] { return part.rows->fill(t, y, rows_.gradients().data() + part.first); }, thrown);
    if (flag != 0) return failed(flag, "Gradients::fill", thrown);
  }
  return Status::success;
}

bool GradientStore::contains_algebraic(N_Vector id) {
  for (N_Vector row : rows_.gradients()) {
    N_VProd(id, row, work_);
    N_VLinearSum(1.0, row, -1.0, work_, work_);
    if (N_VMaxNorm(work_) > 0.0) return true;
  }
  return false;
}

void GradientStore::sum_terms(N_Vector y) {
  if (y->ops->nvl1norm == nullptr) return;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    N_VProd(rows_.gradients()[i], y, work_);
    terms_[i] = N_VL1Norm(work_);
  }
}

Status GradientStore::factor(const VectorMetric& metric, N_Vector terms_at) {
  if (terms_at != nullptr) sum_terms(terms_at);
  return factor(metric.D(), metric.WT());
}

Status GradientStore::factor(N_Vector D, N_Vector WT) {
  ++statistics_.factorizations;
  const int bad = rows_.factor(D, WT);
  if (bad >= 0) {
    report.text = "the gradient of " + constraints_.name(bad) + " is not finite";
    return Status::not_finite;
  }
  if (rows_.rank() < rows_.rows()) ++statistics_.rank_drops;
  return Status::success;
}

bool GradientStore::contradict(N_Vector) {
  std::vector<int> found = rows_.contradicting();
  if (found.empty()) return false;
  report.contradicting(std::move(found), constraints_);
  return true;
}

bool GradientStore::rounding_only() const {
  const double unit = 64.0 * kEpsilon;
  for (std::size_t i = 0; i < g_.size(); ++i)
    if (!(std::abs(g_[i]) <= unit * terms_[i])) return false;
  return true;
}

double GradientStore::drift() const {
  double largest = 0.0;
  for (double g : g_) largest = std::max(largest, std::abs(g));
  return largest;
}

std::unique_ptr<RowsAt> make_gradient_rows(const Constraints& constraints, const Options& options,
                                           Statistics& statistics, N_Vector like) {
  return std::make_unique<VectorRows<GradientStore>>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
