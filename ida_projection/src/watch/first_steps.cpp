// Tether: rows that F does not keep, and tolerances above the solution, are seen in the first
// steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <sstream>

#include "attach/impl.hpp"

namespace tether::ida_projection {

namespace {

constexpr long kSettled = 2;             // accepted steps: before, y' is still that of the start
constexpr double kNoInvariant = 1e-2;    // of the terms of C y'; the corrector knows y' better
constexpr double kFelt = 1.0;            // tolerances in one step: less may be noise of y'
constexpr int kDoubts = 5, kLooks = 20;  // steps in a row with a doubt of one sign; looks into them
constexpr long kSearchLimit = 2000;      // unknowns up to which entries of C are compared
constexpr long kFirstLook = 6, kLastLook = 10;  // accepted steps, at the solution's size
constexpr double kMoves = 0.05;                 // of y in a step: it is no state of rest

}  // namespace

// After a successful move; the corrector's own correction is in newton_.
void Projection::Impl::look_at_first_steps(const Candidate& candidate, const StepData& step) {
  if (last_steps_ < kSettled || repeated_ || warning_status != Status::success) return;
  if (last_steps_ >= kFirstLook && last_steps_ <= kLastLook && last_steps_ % 2 == 0)
    look_at_tolerances(candidate, step);
  // In forms of index 2 and more y' and multipliers carry the error of derivatives that F lacks.
  if (high_index_ || !index_known_) return;
  if (contiguous_ && has_values(constraints) && looks_ < kLooks)
    look_for_false_rows(candidate, step);
}

// With |y| below a tolerance in the norm of the error test, y = 0 would pass as well.
void Projection::Impl::look_at_tolerances(const Candidate& candidate, const StepData& step) {
  N_VLinearSum(1.0, candidate.base, 1.0, newton_, saved_);
  const double size = N_VWrmsNorm(saved_, candidate.weights);
  N_VLinearSum(1.0, step.yp_predicted, step.cj, newton_, saved_);
  const double change = std::abs(step_size()) * N_VWrmsNorm(saved_, candidate.weights);
  if (!(size < 1.0) || !(change > kMoves * size)) return;
  if (++small_looks_ < (kLastLook - kFirstLook) / 2 + 1) return;
  std::ostringstream out;
  out << "the whole solution is " << size << " tolerances long at t = " << step.t
      << ", so that IDA's error test cannot see it: reduce atol";
  warn(Status::doubtful, out.str());
}

// C y' + g_t = 0 at the corrector's point, where y' fulfils F. C y' costs a product with the C at
// hand; only where a row stands out is g evaluated.
void Projection::Impl::look_for_false_rows(const Candidate& candidate, const StepData& step) {
  const auto n = static_cast<std::size_t>(size_);
  corrected_.resize(n);
  slope_.resize(n);
  const double* predicted = N_VGetArrayPointer(step.yp_predicted);
  for (std::size_t j = 0; j < n; ++j) {
    corrected_[j] = candidate.base_entries[j] + newton_entries_[j];
    slope_[j] = predicted[j] + step.cj * newton_entries_[j];
  }
  const double* id = has_algebraic_ ? N_VGetArrayPointer(id_) : nullptr;
  if (!mover_->tangency(slope_, id, tangency_)) return;
  const double felt = kFelt * std::sqrt(static_cast<double>(size_));
  for (std::size_t i = 0; i < tangency_.rate.size(); ++i) {
    const double rate = std::abs(tangency_.rate[i]);
    int& doubts = row_doubts_[i];  // with the sign of the rate: noise changes it
    const bool doubtful = tangency_.terms[i] >= 0.0 && rate > kNoInvariant * tangency_.terms[i] &&
                          rate * std::abs(step_size()) > felt * tangency_.tolerance[i];
    if (!doubtful)
      doubts = 0;
    else
      doubts = tangency_.rate[i] > 0.0 ? std::max(doubts, 0) + 1 : std::min(doubts, 0) - 1;
    if (std::abs(doubts) < kDoubts) continue;
    doubts = 0;
    const std::string text = false_row(static_cast<int>(i), tangency_, step);
    if (!text.empty()) return warn(Status::doubtful, text);
    if (++looks_ >= kLooks) return;
  }
}

// What is wrong with the row: dg/dt along y' and g_t by central differences of g, which know no C.
std::string Projection::Impl::false_row(int row, const Tangency& seen, const StepData& step) {
  const auto i = static_cast<std::size_t>(row);
  Evaluator evaluator(constraints, statistics_);
  std::vector<double> plus(row_doubts_.size()), minus(row_doubts_.size()), y(corrected_);
  double fastest = 1.0 / std::max(1.0, std::abs(step.t));
  for (std::size_t j = 0; j < y.size(); ++j)
    fastest = std::max(fastest, std::abs(slope_[j]) / std::max(1.0, std::abs(corrected_[j])));
  const double h = std::cbrt(2e-16) / fastest;
  const auto difference = [&](bool along, double* slope) {
    const auto at = [&](double change, std::vector<double>& g) {
      for (std::size_t j = 0; along && j < y.size(); ++j) y[j] = corrected_[j] + change * slope_[j];
      return evaluator.value(step.t + change, y.data(), size_, g.data()) == Status::success;
    };
    const bool known = at(h, plus) && at(-h, minus);
    *slope = known ? (plus[i] - minus[i]) / (2.0 * h) : 0.0;
    y = corrected_;
    return known;
  };
  double along = 0.0, in_time = 0.0;
  const bool known = difference(true, &along) && difference(false, &in_time);
  if (evaluator.fatal()) stop(-1, evaluator.message());
  if (!known) return {};
  const double terms = seen.terms[i] + std::abs(in_time);
  const double felt = kFelt * std::sqrt(static_cast<double>(size_)) * seen.tolerance[i];
  std::ostringstream out;
  if (std::abs(along) > kNoInvariant * terms && std::abs(along * step_size()) > felt) {
    out << "F does not keep row " << row << " (" << constraints.name(row) << "): at t = " << step.t
        << " C y' + g_t = " << along << ", its terms sum up to " << terms
        << " in absolute value; check the row, its constants and F";
    return out.str();
  }
  if (std::abs(seen.rate[i] + in_time - along) > kNoInvariant * terms && size_ <= kSearchLimit) {
    const std::string found = wrong_entry(step.t);
    if (!found.empty())
      return "check_jacobian finds at t = " + std::to_string(step.t) + ": " + found;
  }
  return {};
}

// The wrong entry of C by check_jacobian at the corrector's point; empty: none.
std::string Projection::Impl::wrong_entry(double t) {
  try {
    const JacobianReport report = check_jacobian(constraints, t, corrected_, 1e-3);
    return report.correct ? std::string() : report.message;
  } catch (const std::invalid_argument&) {  // g refuses a point nearby: nothing is known
    return {};
  }
}

}  // namespace tether::ida_projection
