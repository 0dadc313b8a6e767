// Tether: what makes IDA reject most steps is looked for and said, once.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <sstream>
#include <vector>

#include "attach/impl.hpp"

namespace tether::ida_projection {

namespace {

constexpr long kWindow = 200;          // accepted steps
constexpr int kSayAfter = 4;           // failures in one step; IDA gives up after ten
constexpr int kLargestSearch = 2000;   // unknowns up to which columns are looked at one by one
constexpr double kNoInvariant = 1e-2;  // of the terms of C y'; the corrector knows y' better

}  // namespace

// At each new attempt: was the last one rejected? In most steps of a stretch?
void Projection::Impl::count_rejections() {
  if (repeated_) {
    ++rejections_;
    rejected_in_step_ = true;
    return;
  }
  if (rejected_in_step_) ++refused_steps_;
  rejected_in_step_ = false;
  if (last_steps_ < window_begin_ + kWindow) return;
  if (3 * refused_steps_ > kWindow) collapsed_ = true;
  window_begin_ = last_steps_;
  refused_steps_ = 0;
  if (!collapsed_) rejections_before_ = rejections_;
}

void Projection::Impl::say_once(const std::string& text) {
  if (options_.print_warnings) std::fprintf(stderr, "tether: %s\n", text.c_str());
}

void Projection::Impl::count_failure_in_step(const std::string& text) {
  failures_in_step_ = last_steps_ == failing_step_ ? failures_in_step_ + 1 : 1;
  failing_step_ = last_steps_;
  if (failures_in_step_ < kSayAfter || said_failures_) return;
  said_failures_ = true;
  std::ostringstream out;
  out << "step " << last_steps_ + 1 << " was tried " << failures_in_step_
      << " times without a point on the constraints: " << text;
  say_once(out.str());
}

// At the corrector's point, where y' = yppred + cj ycor fulfils F.
void Projection::Impl::look_for_causes(const Candidate& candidate, const StepData& step) {
  std::ostringstream out;
  out << "IDA rejected " << rejections_ - rejections_before_ << " attempts in the last " << kWindow
      << " accepted steps before t = " << step.t;
  if (has_algebraic_ && contiguous_ && static_cast<int>(algebraic_.size()) == size_)
    out << "; the id vector calls every variable algebraic: differential ones have to be 1 "
           "(Options::id)";
  if (contiguous_) {
    int below = 0;
    for (int j = 0; j < size_; ++j) {
      const double y = candidate.base_entries[j] + candidate.correction_entries[j];
      below += std::abs(y) * candidate.weight_entries[j] < 1.0 ? 1 : 0;
    }
    if (2 * below > size_)
      out << "; " << below << " of " << size_
          << " unknowns are smaller than their tolerances: reduce atol";
  }
  std::string row = contiguous_ ? suspected_row(candidate, step) : std::string();
  if (row.empty() && contiguous_) row = squared_row(candidate);
  if (row.empty())
    out << "; check the rows with check_jacobian, the id vector and the tolerances";
  else
    out << "; " << row;
  warn(Status::collapsed, out.str());
}

void Projection::Impl::warn(Status kind, const std::string& text) {
  warning = text;
  warning_status = kind;
  if (said_warning_ != kind) say_once(warning);  // not again after every IDAReInit
  said_warning_ = kind;
}

// A row with a double root: Newton's move for it alone leaves a fourth of g.
std::string Projection::Impl::squared_row(const Candidate& candidate) {
  if (!has_values(constraints) || size_ > kLargestSearch) return {};
  const auto n = static_cast<std::size_t>(size_);
  Evaluator evaluator(constraints, statistics_);
  const auto m = static_cast<std::size_t>(evaluator.rows());
  std::vector<double> y(n), WT(n), g(m), left(m), C(m * n);
  std::vector<int> columns(n);
  for (std::size_t j = 0; j < n; ++j) {
    const double w = candidate.weight_entries[j];
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
    WT[j] = w > 0.0 ? 1.0 / w : 0.0;
    columns[j] = static_cast<int>(j);
  }
  const double t = candidate.t;
  std::string found;
  if (evaluator.value(t, y.data(), size_, g.data()) == Status::success &&
      evaluator.jacobian(t, y.data(), size_, WT.data(), columns, C.data()) == Status::success)
    for (std::size_t i = 0; i < m && found.empty(); ++i) {
      double square = 0.0;
      for (std::size_t j = 0; j < n; ++j) square += std::pow(C[i * n + j] * WT[j], 2);
      if (!(square > 0.0) || g[i] == 0.0) continue;
      std::vector<double> moved = y;
      for (std::size_t j = 0; j < n; ++j) moved[j] -= g[i] / square * C[i * n + j] * WT[j] * WT[j];
      if (evaluator.value(t, moved.data(), size_, left.data()) != Status::success) continue;
      if (std::abs(left[i] / g[i] - 0.25) < 0.05)
        found = "row " + std::to_string(i) + " (" + constraints.name(static_cast<int>(i)) +
                ") looks like a square: Newton's move leaves a fourth of g, as at a double root; "
                "write it without the square";
    }
  if (evaluator.fatal()) stop(-1, evaluator.message());
  return found;
}

// A wrong row of C, or a row that F does not keep: C y' + g_t, term by term from differences of g.
std::string Projection::Impl::suspected_row(const Candidate& candidate, const StepData& step) {
  if (!has_values(constraints) || size_ > kLargestSearch) return {};
  const auto n = static_cast<std::size_t>(size_);
  std::vector<double> y(n), yp(n);
  const double* predicted = N_VGetArrayPointer(step.yp_predicted);
  for (std::size_t j = 0; j < n; ++j) {
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
    yp[j] = predicted[j] + step.cj * candidate.correction_entries[j];
  }
  try {
    const JacobianReport report = check_jacobian(constraints, candidate.t, y, 1e-3);
    if (!report.correct) return "check_jacobian finds there: " + report.message;
  } catch (const std::exception&) {  // g refuses a point nearby: nothing is known
    return {};
  }
  Statistics ignored;
  Evaluator evaluator(constraints, ignored);
  const auto m = static_cast<std::size_t>(evaluator.rows());
  std::vector<double> plus(m), minus(m), rate(m, 0.0), size(m, 0.0);
  const double h = std::cbrt(2e-16);
  for (std::size_t j = 0; j <= n; ++j) {  // the last one is t
    const double length = h * std::max(1.0, std::abs(j < n ? y[j] : candidate.t));
    const double speed = j < n ? yp[j] : 1.0;
    const auto at = [&](double change, std::vector<double>& g) {
      const double kept = j < n ? y[j] : 0.0;
      if (j < n) y[j] += change;
      const double t = candidate.t + (j < n ? 0.0 : change);
      const bool known = evaluator.value(t, y.data(), size_, g.data()) == Status::success;
      if (j < n) y[j] = kept;
      return known;
    };
    if (!at(length, plus) || !at(-length, minus)) return {};
    for (std::size_t i = 0; i < m; ++i) {
      const double term = (plus[i] - minus[i]) / (2.0 * length) * speed;
      rate[i] += term;
      size[i] += std::abs(term);
    }
  }
  std::size_t worst = 0;
  for (std::size_t i = 0; i < m; ++i)
    if (std::abs(rate[i]) * size[worst] > std::abs(rate[worst]) * size[i]) worst = i;
  if (!(std::abs(rate[worst]) > kNoInvariant * size[worst])) return {};
  std::ostringstream out;
  out << "F does not keep row " << worst << " (" << constraints.name(static_cast<int>(worst))
      << "): C y' + g_t = " << rate[worst] << ", its terms sum up to " << size[worst]
      << " in absolute value";
  return out.str();
}

}  // namespace tether::ida_projection
