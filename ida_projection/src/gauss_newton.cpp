// Tether: a point far from the constraints onto them. SPDX-License-Identifier: BSD-3-Clause
#include "gauss_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::ida_projection {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr int kMaximumIterations = 60;
constexpr double kSmallestDamping = 1.0 / 1024.0;
constexpr double kConverged = 1e-8;  // tolerances: quadratic convergence makes this round-off

}  // namespace

GaussNewton::GaussNewton(const Constraints& constraints, int size)
    : constraints_(constraints),
      evaluator_(constraints, counts_),
      blocks_(constraints, evaluator_.rows(), size),
      n_(size),
      m_(evaluator_.rows()) {
  const auto n = static_cast<std::size_t>(n_);
  const auto m = static_cast<std::size_t>(m_);
  g_.assign(m, 0.0);
  C_.assign(m * n, 0.0);
  rank_tolerance_ = evaluator_.uses_differences() ? 1e-6 : std::max(m_, n_) * 1e-13;
}

bool GaussNewton::evaluate(double t, const std::vector<double>& y, ConsistencyReport& report) {
  report.status = evaluator_.value(t, y.data(), n_, g_.data());
  if (report.status != Status::success) report.message = evaluator_.message();
  return report.status == Status::success;
}

double GaussNewton::correction() {
  blocks_.solve(g_, C_);
  double sum = 0.0;
  for (const Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size(); ++k) {
      const double move = block->dy[k] / WT_[static_cast<std::size_t>(block->columns[k])];
      if (!block->rows.empty()) sum += move * move;
    }
  return std::sqrt(sum / n_);
}

double GaussNewton::largest(const std::vector<double>& g) const {
  double value = 0.0;
  for (double x : g) value = std::max(value, std::abs(x));
  return value;
}

void GaussNewton::project(double t, std::vector<double>& y0, const std::vector<double>& WT,
                          const std::vector<bool>& hold, const double* id,
                          ConsistencyReport& report) {
  WT_ = WT;
  std::vector<double> y = y0;
  report.status = blocks_.structure(evaluator_, t, y, WT_, hold, id, C_);
  if (report.status != Status::success) {
    report.message = blocks_.message;
    return;
  }
  for (Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size(); ++k)
      block->D()[k] = WT_[static_cast<std::size_t>(block->columns[k])];

  if (!evaluate(t, y, report)) return;
  report.drift_before = report.drift_after = largest(g_);

  const std::vector<int>& columns = blocks_.columns;
  double previous = -1.0;
  int halvings_in_a_row = 0;
  std::vector<double> trial(y.size()), dy(y.size());
  for (report.iterations = 0;; ++report.iterations) {
    if (report.iterations == kMaximumIterations) {
      report.status = Status::not_converged;
      break;
    }
    report.status = evaluator_.jacobian(t, y.data(), n_, WT_.data(), columns, C_.data());
    if (report.status != Status::success || !blocks_.factor(C_, rank_tolerance_)) {
      report.message = report.status != Status::success
                           ? evaluator_.message()
                           : "the constraint Jacobian C has an entry that is not finite";
      if (report.status == Status::success) report.status = Status::not_finite;
      return;
    }
    const double length = correction();
    report.rank = blocks_.rank();
    double size = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) size += y[i] / WT_[i] * (y[i] / WT_[i]);
    const double floor = 64.0 * kEpsilon * std::sqrt(size / n_);
    if (length <= std::max(kConverged, floor)) break;
    // Rounding: small already, and no longer shrinking.
    if (previous >= 0.0 && length <= 1e4 * floor && length > 0.5 * previous) break;
    // Gradients that vanish on the set: the distance halves, |g| falls to a quarter.
    const double rate = previous > 0.0 ? length / previous : 0.0;
    halvings_in_a_row = rate > 0.4 && rate < 0.6 ? halvings_in_a_row + 1 : 0;
    if (halvings_in_a_row >= 4) report.slow_convergence = true;
    previous = length;

    std::fill(dy.begin(), dy.end(), 0.0);
    for (const Block* block : {&blocks_.d, &blocks_.a})
      for (std::size_t k = 0; k < block->columns.size() && !block->rows.empty(); ++k)
        dy[static_cast<std::size_t>(block->columns[k])] = block->dy[k];
    double s = 1.0;
    bool accepted = false;
    for (; s >= kSmallestDamping && !accepted; s *= 0.5) {
      for (std::size_t i = 0; i < y.size(); ++i) trial[i] = y[i] - s * dy[i];
      ConsistencyReport attempt;
      if (!evaluate(t, trial, attempt)) {
        report.message = attempt.message;
        continue;
      }
      accepted = correction() <= (1.0 - 0.5 * s) * length + floor;
    }
    if (!accepted) {
      evaluate(t, y, report);
      report.status = Status::not_converged;
      break;
    }
    report.message.clear();
    y = trial;
  }

  report.drift_after = largest(g_);
  if (report.status == Status::success && blocks_.dropped_rows() && blocks_.contradict(C_, WT_)) {
    report.status = Status::inconsistent;
    report.message = blocks_.message;
    report.contradicting_rows = blocks_.rows();
  } else if (report.status == Status::not_converged) {
    if (blocks_.dropped_rows() && blocks_.contradict(C_, WT_)) {
      report.status = Status::inconsistent;
      report.message = blocks_.message;
      report.contradicting_rows = blocks_.rows();
    } else {
      report.message = "no point on the constraints was found near the given one: |g| is " +
                       std::to_string(report.drift_before) + " there and stalls at " +
                       std::to_string(report.drift_after) +
                       "; the rows may have no common solution, or the start is too far away";
    }
  } else if (report.slow_convergence) {
    report.message =
        "gradients vanish on the constraints: Newton's method only halves the distance, and |g| "
        "says little about it; write the rows without squares";
  }
  if (report.status == Status::success) y0 = y;
}

bool GaussNewton::tangent(double t, const std::vector<double>& y, double* yp) {
  const double h = std::cbrt(kEpsilon) * std::max(1.0, std::abs(t));
  std::vector<double> plus(g_.size()), minus(g_.size());
  if (evaluator_.value(t + h, y.data(), n_, plus.data()) != Status::success ||
      evaluator_.value(t - h, y.data(), n_, minus.data()) != Status::success ||
      evaluator_.jacobian(t, y.data(), n_, WT_.data(), blocks_.columns, C_.data()) !=
          Status::success ||
      !blocks_.factor(C_, rank_tolerance_))
    return false;
  std::vector<double> defect(g_.size());
  for (std::size_t i = 0; i < g_.size(); ++i) {
    // Differences of a g that does not contain t are exactly zero.
    defect[i] = (plus[i] - minus[i]) / (2.0 * h);
    for (int j = 0; j < n_; ++j)
      defect[i] += C_[i * static_cast<std::size_t>(n_) + static_cast<std::size_t>(j)] * yp[j];
  }
  blocks_.solve(defect, C_);
  for (const Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size() && !block->rows.empty(); ++k)
      yp[block->columns[k]] -= block->dy[k];
  return true;
}

}  // namespace tether::ida_projection
