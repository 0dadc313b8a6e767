// Tether: rows that F does not keep, and tolerances above the solution, are seen in the first
// steps. SPDX-License-Identifier: BSD-3-Clause
#include "watch/first_steps.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kOffItsSet = 2.0;  // tolerances: F has moved a row so far off its set
constexpr int kRefinements = 3;
constexpr double kSettles = 0.01;   // change of the rate in the last of them, see diagnose()
constexpr double kAgree = 0.5;      // of what is noticed, to confirm it; of a rate, its next change
constexpr double kRounding = 1e-9;  // of the terms: differences of g know no less
constexpr int kSeen = 3;            // times, before a vanished row or a small solution is said
constexpr double kMoves = 0.05;     // of y in a step: it is no state of rest
constexpr double kGrows = 1.02;     // for each step: a solution from zero may be small at first

// Checks of suspected rows that are allowed until the step after so many.
long allowed_checks(long steps) { return 20 + steps / 100; }

}  // namespace

void FirstSteps::reset() {
  run_ = Run();
  run_.rows.resize(static_cast<std::size_t>(constraints_.total_count()));
}

std::string FirstSteps::check(const Candidate& candidate, const Attempt& attempt,
                              N_Vector corrected, const AlgebraicVariables& variables, RowsAt& rows,
                              Corrector& corrector) {
  Corrected at{candidate, attempt, corrected, attempt.h, nullptr, corrector};
  std::string found = compare_with_tolerances(at);
  // In forms of index 2 and more y' and multipliers carry the error of derivatives that F lacks.
  if (!found.empty() || variables.high_index() || !variables.index_known()) return found;
  const long steps = attempt.steps;
  const bool due = steps > kSteps || steps % 2 == 0;
  if (!due || run_.checks >= allowed_checks(steps) || candidate.base_entries == nullptr ||
      !has_values(constraints_))
    return found;
  at.id = variables.mask();
  at.span *= static_cast<double>(std::max(1L, steps - std::exchange(run_.last_check, steps)));
  return find_false_rows(at, rows);
}

// If |y| is below a tolerance in the norm of the error test, y = 0 would pass the test as well. A
// solution that has decayed, or still grows, is no fault of the tolerances.
std::string FirstSteps::compare_with_tolerances(const Corrected& at) {
  if (!(run_.largest < 1.0) || at.attempt.steps > kSteps) return {};
  N_Vector weights = at.candidate.weights;
  if (!work_) work_ = OwnedVector(weights);
  N_VLinearSum(1.0, at.candidate.base, 1.0, at.ycor, work_);
  const double size = N_VWrmsNorm(work_, weights);
  N_VLinearSum(1.0, at.candidate.predicted_slope, at.attempt.cj, at.ycor, work_);
  const double change = std::abs(at.span) * N_VWrmsNorm(work_, weights);
  const bool grows = size > kGrows * run_.largest;
  run_.largest = std::max(run_.largest, size);
  if (!(size < 1.0) || grows || !(change > kMoves * size)) return {};
  if (++run_.small_solutions != kSeen) return {};
  return "the whole solution is " + brief(size) + " tolerances long at t = " + brief(at.attempt.t) +
         ", so that IDA's error test cannot see it: reduce atol";
}

// Tests C y' + g_t = 0 at the corrector's point, where y' satisfies F. C y' costs a product with
// the present C; g is evaluated only for a row that stands out.
std::string FirstSteps::find_false_rows(const Corrected& at, RowsAt& rows) {
  const auto n = static_cast<std::size_t>(N_VGetLength(at.candidate.base));
  if (point_.size() != n) {  // all that a comparison needs, so that none allocates
    for (std::vector<double>* each : {&point_, &slope_, &better_, &better_p_}) each->resize(n);
    rates_.resize(run_.rows.size());
    faults_.reserve(n);
    for (OwnedVector* each : {&work_, &base_, &ycor_}) *each = OwnedVector(at.candidate.base);
  }
  const double* predicted = N_VGetArrayPointer(at.candidate.predicted_slope);
  const double* ycor = N_VGetArrayPointer(at.ycor);
  for (std::size_t j = 0; j < n; ++j) {
    point_[j] = at.candidate.base_entries[j] + ycor[j];
    slope_[j] = predicted[j] + at.attempt.cj * ycor[j];
  }
  if (rows.age > 0 || !rows.tangency(slope_, at.id, tangency_)) return {};
  std::string text = find_one_sided_row(at.attempt.t);
  if (!text.empty()) return text;
  const double root = std::sqrt(static_cast<double>(n));
  for (std::size_t i = 0; i < tangency_.rate.size(); ++i) {
    if (tangency_.terms[i] < 0.0 && tangency_.size[i] == 0.0 && run_.idle_row.empty())
      run_.idle_row = faults_.name(static_cast<int>(i)) +
                      " has algebraic variables only, which F determines by itself: it moves "
                      "nothing else and may be left out";
    if (!(tangency_.terms[i] >= 0.0)) continue;
    Row& row = run_.rows[i];
    row.sum += tangency_.rate[i] * at.span;
    row.span += at.span;
    const double noticed = kOffItsSet * root * tangency_.tolerance[i];
    if (!(std::abs(row.sum) > row.limit * noticed) && row.suspected == 0.0) continue;
    text = diagnose(static_cast<int>(i), noticed, at);
    row.sum = row.span = 0.0;
    row.limit *= 2.0;  // what was noise is so again
    ++run_.checks;
    if (!text.empty()) return text;
  }
  return {};
}

// Finds a row such as max(u, 0), which is zero on one side of its set. Hosts that switch rows off
// have many that vanish; all are tested together.
std::string FirstSteps::find_one_sided_row(double t) {
  std::vector<int> rows;
  for (std::size_t i = 0; i < tangency_.tolerance.size(); ++i)
    if (tangency_.tolerance[i] == 0.0 && ++run_.rows[i].vanished == kSeen)
      rows.push_back(static_cast<int>(i));
  return rows.empty() ? "" : faults_.one_sided(rows, t, point_);
}

// Refines y' by one iteration for F at better_. It then contains neither the rest that IDA's
// convergence test allows nor the distance from the constraints. ycor_ begins as the corrector's.
bool FirstSteps::refine_slope(const Corrected& at) {
  double* const base = at.candidate.base_entries;
  double* const correction = N_VGetArrayPointer(ycor_);
  N_VScale(1.0, at.candidate.base, base_);
  for (std::size_t j = 0; j < better_.size(); ++j) base[j] = better_[j] - correction[j];
  const bool known = at.corrector.residual(ycor_, work_) == 0;
  N_VScale(1.0, base_, at.candidate.base);
  if (!known) return false;
  N_VScale(-1.0, work_, work_);
  if (!at.corrector.solve_linear(work_)) return false;
  const double* delta = N_VGetArrayPointer(work_);
  for (std::size_t j = 0; j < better_.size(); ++j) {
    correction[j] += delta[j];
    better_p_[j] += at.attempt.cj * delta[j];
    if (at.id != nullptr && at.id[j] == 0.0) better_[j] += delta[j];
  }
  return true;
}

// Returns the fault of the row, or an empty text.
std::string FirstSteps::diagnose(int row, double noticed, const Corrected& at) {
  const auto i = static_cast<std::size_t>(row);
  const double t = at.attempt.t;
  const auto rate_along = [&](const std::vector<double>& y, const std::vector<double>& yp) {
    return faults_.rates(t, y, yp, rates_) ? rates_[i] : 0.0;
  };
  better_p_ = slope_;
  for (std::size_t j = 0; j < better_.size(); ++j)
    better_[j] = at.candidate.base_entries[j] + at.candidate.correction_entries[j];
  N_VScale(1.0, at.ycor, ycor_);
  double before = 0.0, along = 0.0;
  bool known = true;
  for (int k = 0; k < kRefinements && known; ++k) {
    known = refine_slope(at);
    if (known && k + 2 >= kRefinements)
      before = std::exchange(along, rate_along(better_, better_p_));
  }
  const double rounding = kRounding * tangency_.size[i] * faults_.fastest(t, better_, better_p_);
  std::fill(better_p_.begin(), better_p_.end(), 0.0);
  const double in_time = known ? rate_along(better_, better_p_) : 0.0;
  faults_.pass_end_to(at.corrector);
  if (!known) return {};
  const double terms = tangency_.terms[i] + std::abs(in_time);
  Row& of = run_.rows[i];
  const bool settled =
      std::abs(along) > rounding && std::abs(along - before) <= kSettles * std::abs(along);
  if (settled) of.verified += along * of.span;
  const double earlier = std::exchange(of.suspected, 0.0);
  if (settled && std::abs(of.verified) > kAgree * noticed) of.suspected = along;
  // At a singular position F determines no y', whatever the sum: the next check decides.
  if (std::abs(earlier - of.suspected) < kAgree * std::abs(of.suspected)) {
    run_.false_row_found = true;
    return faults_.unkept_text(row, "at t = " + brief(t) + " ", along, terms);
  }
  const double without_C = rate_along(point_, slope_);
  faults_.pass_end_to(at.corrector);
  if (!(std::abs(tangency_.rate[i] + in_time - without_C) > kNoInvariant * terms) || !may_search())
    return {};
  run_.searched += point_.size();  // the present C may be of an earlier step: mostly it is right
  const std::string found = faults_.wrong_entry(t, point_);
  return found.empty() ? found : "check_jacobian finds at t = " + brief(t) + ": " + found;
}

}  // namespace tether::ida_projection
