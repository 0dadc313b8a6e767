// Tether: a few full rows beside many sparse ones. SPDX-License-Identifier: BSD-3-Clause
#include "distributed/border.hpp"

#include <algorithm>
#include <cmath>

namespace tether::ida_projection {

namespace {

// A part of a full row: solutions with C leave less of one that depends on it.
constexpr double kDependent = 1e-5;

double norm(N_Vector v) { return std::sqrt(N_VDotProd(v, v)); }

// v <- v / D, 0 where D = 0. Of this process.
void divide(N_Vector v, N_Vector D, long n) {
  double* entry = N_VGetArrayPointer(v);
  const double* by = N_VGetArrayPointer(D);
  for (long j = 0; j < n; ++j) entry[j] = by[j] > 0.0 ? entry[j] / by[j] : 0.0;
}

}  // namespace

Constraints Border::joined(const Constraints& all) {
  Constraints set;
  set.jacobian = Gradients();
  set.joined = all.joined;
  return set;
}

Border::Border(const Constraints& constraints, N_Vector like)
    : set_(joined(constraints)),
      rows_(set_, uncounted_, like),
      depends_(rows_.gradients().size(), 0),
      wanted_(depends_.size(), 0.0),
      beyond_(wanted_),
      may_be_left_(wanted_),
      work_(like),
      unknowns_(std::get<DistributedRows>(constraints.jacobian).unknowns) {
  for (std::size_t k = 0; k < depends_.size(); ++k) raw_.emplace_back(like);
}

Status Border::factor(const VectorMetric& metric, const Onto& onto) {
  const double share = 0.5 * std::sqrt(static_cast<double>(N_VGetLength(work_)));
  for (std::size_t k = 0; k < raw_.size(); ++k) {
    N_Vector row = rows_.gradients()[k];
    N_VScale(1.0, row, raw_[k]);
    N_VProd(row, metric.WT(), work_);
    may_be_left_[k] = share * norm(work_);
    N_VProd(row, metric.D(), work_);
    const double before = norm(work_);
    N_VProd(work_, metric.D(), work_);
    onto(work_, row);
    N_VLinearSum(1.0, work_, -1.0, row, row);
    divide(row, metric.D(), unknowns_);
    depends_[k] = !(norm(row) > kDependent * before) ? 1 : 0;
    if (depends_[k] != 0 && std::isfinite(before)) N_VConst(0.0, row);
    divide(row, metric.D(), unknowns_);
  }
  return rows_.factor(metric, nullptr);
}

void Border::add(N_Vector D, N_Vector dy) {
  for (std::size_t k = 0; k < raw_.size(); ++k) {
    beyond_[k] = rows_.g()[k] - N_VDotProd(raw_[k], dy);
    wanted_[k] = depends_[k] != 0 ? 0.0 : beyond_[k];
  }
  rows_.solve(wanted_, D, work_);
  N_VLinearSum(1.0, dy, 1.0, work_, dy);
}

bool Border::whole() const {
  return std::all_of(depends_.begin(), depends_.end(), [](char one) { return one == 0; }) &&
         rows_.whole();
}

bool Border::contradict() {
  for (std::size_t k = 0; k < raw_.size(); ++k) {
    if (depends_[k] == 0 || std::abs(beyond_[k]) <= may_be_left_[k]) continue;
    rows_.report.text = set_.name(static_cast<int>(k)) + " contradicts the rows that it depends on";
    return true;
  }
  return rows_.contradict(work_);
}

}  // namespace tether::ida_projection
