// Tether: rows that F does not keep, and tolerances above the solution, are seen in the first
// steps. SPDX-License-Identifier: BSD-3-Clause
#include "watch/first_steps.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/shortest.hpp"
#include "watch/kink.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kOffItsSet = 2.0;  // tolerances: F has moved a row so far off its set
constexpr int kRefinements = 3;
constexpr double kSettles = 0.1;    // changes of the rate in the last of them
constexpr double kRounding = 1e-9;  // of the terms: differences of g know no less
constexpr double kConfirmed = 0.5;  // of it, by a better y'
constexpr long kFreeChecks = 20, kStepsPerCheck = 100;  // into doubts
constexpr long kSearchLimit = 2000;  // evaluations of g in one direction to compare entries of C
constexpr int kVanished = 3;         // steps in which a row of C is zero
constexpr int kSmallSolutions = 3;   // at a solution below its tolerances
constexpr double kMoves = 0.05;      // of y in a step: it is no state of rest
constexpr double kGrows = 1.02;      // for each step: a solution from zero may be small at first

}  // namespace

void FirstSteps::reset() {
  changes_.assign(static_cast<std::size_t>(constraints_.total_count()), {});
  vanished_.assign(changes_.size(), 0);
  checks_ = small_solutions_ = 0;
  last_check_ = kSettled;
  false_row_found_ = false;
  idle_row_.clear();
  largest_ = 0.0;
  searched_ = 0;
}

std::string FirstSteps::check(const Candidate& candidate, const StepData& step, long steps,
                              double h, N_Vector corrected, const AlgebraicVariables& variables,
                              Mover& mover, Corrector& corrector) {
  std::string found;
  if (largest_ < 1.0 && steps <= kSteps)
    found = compare_with_tolerances(candidate, step, h, corrected);
  // In forms of index 2 and more y' and multipliers carry the error of derivatives that F lacks.
  if (!found.empty() || variables.high_index() || !variables.index_known()) return found;
  const bool due = steps > kSteps || steps % 2 == 0;
  const bool may = checks_ < kFreeChecks + steps / kStepsPerCheck;
  if (!due || !may || candidate.base_entries == nullptr || !has_values(constraints_)) return found;
  const double span = h * static_cast<double>(std::max(1L, steps - last_check_));
  last_check_ = steps;
  found = find_false_rows(candidate, step, span, corrected, variables.mask(), mover, corrector);
  return found;
}

// If |y| is below a tolerance in the norm of the error test, y = 0 would pass the test as well. A
// solution that has decayed, or still grows, is no fault of the tolerances.
std::string FirstSteps::compare_with_tolerances(const Candidate& candidate, const StepData& step,
                                                double h, N_Vector corrected) {
  if (!work_) work_ = OwnedVector(candidate.base);
  N_VLinearSum(1.0, candidate.base, 1.0, corrected, work_);
  const double size = N_VWrmsNorm(work_, candidate.weights);
  N_VLinearSum(1.0, step.yp_predicted, step.cj, corrected, work_);
  const double change = std::abs(h) * N_VWrmsNorm(work_, candidate.weights);
  const bool grows = size > kGrows * largest_;
  largest_ = std::max(largest_, size);
  if (!(size < 1.0) || grows || !(change > kMoves * size)) return {};
  if (++small_solutions_ != kSmallSolutions) return {};
  PlainText out;
  out << "the whole solution is " << size << " tolerances long at t = " << step.t
      << ", so that IDA's error test cannot see it: reduce atol";
  return out.str();
}

// Allocates the work space of all comparisons.
void FirstSteps::allocate(const Candidate& candidate) {
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
  for (std::vector<double>* each : {&point_, &slope_, &moved_, &kept_point_, &kept_slope_})
    each->resize(n);
  values_.resize(changes_.size());
  evaluator_.reserve(static_cast<int>(n));
  for (OwnedVector* each : {&work_, &base_, &ycor_})
    if (!*each) *each = OwnedVector(candidate.base);
}

// Tests C y' + g_t = 0 at the corrector's point, where y' satisfies F. C y' costs a product with
// the present C; g is evaluated only for a row that stands out.
std::string FirstSteps::find_false_rows(const Candidate& candidate, const StepData& step, double h,
                                        N_Vector corrected, const double* id, Mover& mover,
                                        Corrector& corrector) {
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
  if (point_.size() != n) allocate(candidate);
  const double* predicted = N_VGetArrayPointer(step.yp_predicted);
  const double* ycor = N_VGetArrayPointer(corrected);
  for (std::size_t j = 0; j < n; ++j) {
    point_[j] = candidate.base_entries[j] + ycor[j];
    slope_[j] = predicted[j] + step.cj * ycor[j];
  }
  if (!mover.tangency(slope_, id, tangency_)) return {};
  std::string text_of_side = one_sided_row(step.t);
  if (!text_of_side.empty()) return text_of_side;
  const double root = std::sqrt(static_cast<double>(n));
  for (std::size_t i = 0; i < tangency_.rate.size(); ++i) {
    if (tangency_.terms[i] < 0.0 && tangency_.size[i] == 0.0 && idle_row_.empty())
      idle_row_ = "row " + std::to_string(i) + " (" + constraints_.name(static_cast<int>(i)) +
                  ") has algebraic variables only, which F determines by itself: it moves nothing "
                  "else and may be left out";
    if (!(tangency_.terms[i] >= 0.0)) continue;
    Change& change = changes_[i];
    change.sum += tangency_.rate[i] * h;
    change.span += h;
    const double noticed = kOffItsSet * root * tangency_.tolerance[i];
    if (!(std::abs(change.sum) > change.limit * noticed)) continue;
    std::string text =
        false_row(static_cast<int>(i), change, noticed, candidate, step, id, corrected, corrector);
    change.sum = change.span = 0.0;
    change.limit *= 2.0;  // what was noise is so again
    ++checks_;
    if (!text.empty()) return text;
  }
  return {};
}

// Finds a row such as max(u, 0), which is zero on one side of its set. point_ is the corrector's.
// Hosts that switch rows off have many that vanish; all are tested together.
std::string FirstSteps::one_sided_row(double t) {
  std::vector<int> rows;
  for (std::size_t i = 0; i < tangency_.tolerance.size(); ++i)
    if (tangency_.tolerance[i] == 0.0 && ++vanished_[i] == kVanished)
      rows.push_back(static_cast<int>(i));
  if (rows.empty()) return {};
  const auto size = static_cast<int>(point_.size());
  for (const int row : one_sided(constraints_, rows, t, point_))
    for (int j = 0; j < size && searched_ < kSearchLimit; ++j, ++searched_)
      if (has_kink(constraints_, row, j, 0.0, t, point_))
        return "row " + std::to_string(row) + " (" + constraints_.name(row) +
               ") and its gradient vanish to one side of the set" + kKink;
  return {};
}

// Refines y' by one iteration for F at point_. It then contains neither the rest that IDA's
// convergence test allows nor the distance from the constraints. `ycor` begins as the corrector's.
bool FirstSteps::refine_slope(const Candidate& candidate, const StepData& step, const double* id,
                              N_Vector ycor, Corrector& corrector) {
  N_VScale(1.0, candidate.base, base_);
  double* const correction = N_VGetArrayPointer(ycor);
  for (std::size_t j = 0; j < point_.size(); ++j)
    candidate.base_entries[j] = point_[j] - correction[j];
  const bool known = corrector.residual(ycor, work_) == 0;
  N_VScale(1.0, base_, candidate.base);
  if (!known) return false;
  N_VScale(-1.0, work_, work_);
  if (!corrector.solve_linear(work_)) return false;
  const double* delta = N_VGetArrayPointer(work_);
  for (std::size_t j = 0; j < point_.size(); ++j) {
    correction[j] += delta[j];
    slope_[j] += step.cj * delta[j];
    if (id != nullptr && id[j] == 0.0) point_[j] += delta[j];
  }
  return true;
}

// Largest relative rate of an unknown, or of t.
double FirstSteps::fastest(double t) const {
  double rate = 1.0 / std::max(1.0, std::abs(t));
  for (std::size_t j = 0; j < point_.size(); ++j)
    rate = std::max(rate, std::abs(slope_[j]) / std::max(1.0, std::abs(point_[j])));
  return rate;
}

// dg/dt along slope_ by differences of g, independent of C, to either side. Where F jumps, a row
// that it keeps has a kink, and only one side agrees.
double FirstSteps::rate_along(int row, double t) {
  const double dt = std::cbrt(2e-16) / fastest(t);
  bool known = true;
  const auto at = [&](double time) {
    moved_ = point_;
    for (std::size_t j = 0; j < moved_.size(); ++j) moved_[j] += time * slope_[j];
    known = known && evaluator_.value(t + time, moved_.data(), static_cast<int>(moved_.size()),
                                      values_.data()) == Status::success;
    return values_[static_cast<std::size_t>(row)];
  };
  const double here = at(0.0);
  const auto to = [&](double side) {
    return (4.0 * at(side) - at(2.0 * side) - 3.0 * here) / (2.0 * side);
  };
  const double ahead = to(dt), behind = to(-dt);
  if (!known || !(ahead * behind > 0.0)) return 0.0;
  return std::abs(ahead) < std::abs(behind) ? ahead : behind;
}

// Returns the fault of the row, or an empty text.
std::string FirstSteps::false_row(int row, Change& change, double noticed,
                                  const Candidate& candidate, const StepData& step,
                                  const double* id, N_Vector corrected, Corrector& corrector) {
  const auto i = static_cast<std::size_t>(row);
  const auto size = static_cast<int>(point_.size());
  kept_point_ = point_;
  kept_slope_ = slope_;
  for (std::size_t j = 0; j < point_.size(); ++j)
    point_[j] = candidate.base_entries[j] + candidate.correction_entries[j];
  evaluator_.forget();
  N_VScale(1.0, corrected, ycor_);
  double before = 0.0, along = 0.0;
  bool known = true;
  for (int k = 0; k < kRefinements && known; ++k) {
    known = refine_slope(candidate, step, id, ycor_, corrector);
    if (known && k + 2 >= kRefinements) before = std::exchange(along, rate_along(row, step.t));
  }
  const double rounding = kRounding * tangency_.size[i] * fastest(step.t);
  std::fill(slope_.begin(), slope_.end(), 0.0);
  const double in_time = known ? rate_along(row, step.t) : 0.0;
  point_ = kept_point_;
  slope_ = kept_slope_;
  if (evaluator_.fatal()) corrector.stop(-1, evaluator_.message());
  if (!known) return {};
  const double terms = tangency_.terms[i] + std::abs(in_time);
  if (std::abs(along) > rounding && std::abs(along - before) <= kSettles * std::abs(along))
    change.verified += along * change.span;
  if (std::abs(change.verified) > kConfirmed * noticed) {
    if (searched_ + size <= kSearchLimit && has_kink(constraints_, row, step.t, point_))
      return "row " + std::to_string(row) + " (" + constraints_.name(row) +
             ") at t = " + brief(step.t) + kKink;
    false_row_found_ = true;
    PlainText out;
    out << "F does not keep row " << row << " (" << constraints_.name(row) << "): at t = " << step.t
        << " C y' + g_t = " << along << ", its terms sum up to " << terms << " in absolute value"
        << kRowAdvice;
    return out.str();
  }
  const double without_C = rate_along(row, step.t);
  if (evaluator_.fatal()) corrector.stop(-1, evaluator_.message());
  if (std::abs(tangency_.rate[i] + in_time - without_C) > kNoInvariant * terms &&
      searched_ + size <= kSearchLimit) {
    searched_ += size;  // C at hand may be of an earlier step: mostly nothing is wrong
    const std::string found = wrong_entry(constraints_, step.t, point_);
    if (!found.empty()) return "check_jacobian finds at t = " + brief(step.t) + ": " + found;
  }
  return {};
}

}  // namespace tether::ida_projection
