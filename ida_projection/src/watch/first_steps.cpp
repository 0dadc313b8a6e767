// Tether: rows that F does not keep, and tolerances above the solution, are seen in the first
// steps. SPDX-License-Identifier: BSD-3-Clause
#include "watch/first_steps.hpp"

#include <algorithm>
#include <cmath>

#include "attach/shortest.hpp"
#include "watch/kink.hpp"

namespace tether::ida_projection {

namespace {

constexpr long kSettled = 2;  // accepted steps: before, y' is still that of the start
// The second is for terms that cancel each other, as those of a centripetal acceleration.
constexpr std::array<RowDoubt, 2> kDoubts{{{kNoInvariant, 1.0, 5}, {0.1 * kNoInvariant, 2.0, 10}}};
constexpr int kLooks = 20;           // into doubts
constexpr long kSearchLimit = 2000;  // evaluations of g in one direction to compare entries of C
constexpr int kVanished = 3;         // steps in which a row of C is zero
constexpr int kSmallLooks = 3;       // at a solution below its tolerances
constexpr double kMoves = 0.05;      // of y in a step: it is no state of rest
constexpr double kGrows = 1.02;      // for each step: a solution from zero may be small at first

}  // namespace

void FirstSteps::reset() {
  row_doubts_.assign(static_cast<std::size_t>(constraints_.total_count()), {});
  vanished_.assign(row_doubts_.size(), 0);
  looks_ = small_looks_ = 0;
  doubted_ = false;
  largest_ = 0.0;
  searched_ = 0;
}

std::string FirstSteps::look(const Candidate& candidate, const StepData& step, long steps, double h,
                             N_Vector corrected, const AlgebraicVariables& variables, Mover& mover,
                             Corrector& corrector) {
  std::string found;
  if (steps < kSettled) return found;
  if (largest_ < 1.0) found = look_at_tolerances(candidate, step, h, corrected);
  // In forms of index 2 and more y' and multipliers carry the error of derivatives that F lacks.
  if (!found.empty() || variables.high_index() || !variables.index_known()) return found;
  // Where the last look met no doubt every second step is enough.
  const bool due = doubted_ || steps % 2 == 0;
  if (due && candidate.base_entries != nullptr && has_values(constraints_) && looks_ < kLooks)
    found = look_for_false_rows(candidate, step, h, corrected, variables.mask(), mover, corrector);
  return found;
}

// With |y| below a tolerance in the norm of the error test, y = 0 would pass as well. One that has
// come from above, or still grows, says nothing.
std::string FirstSteps::look_at_tolerances(const Candidate& candidate, const StepData& step,
                                           double h, N_Vector corrected) {
  if (!work_) work_ = OwnedVector(candidate.base);
  N_VLinearSum(1.0, candidate.base, 1.0, corrected, work_);
  const double size = N_VWrmsNorm(work_, candidate.weights);
  N_VLinearSum(1.0, step.yp_predicted, step.cj, corrected, work_);
  const double change = std::abs(h) * N_VWrmsNorm(work_, candidate.weights);
  const bool grows = size > kGrows * largest_;
  largest_ = std::max(largest_, size);
  if (!(size < 1.0) || grows || !(change > kMoves * size)) return {};
  if (++small_looks_ != kSmallLooks) return {};
  PlainText out;
  out << "the whole solution is " << size << " tolerances long at t = " << step.t
      << ", so that IDA's error test cannot see it: reduce atol";
  return out.str();
}

// C y' + g_t = 0 at the corrector's point, where y' fulfils F. C y' costs a product with the C at
// hand; only where a row stands out is g evaluated.
std::string FirstSteps::look_for_false_rows(const Candidate& candidate, const StepData& step,
                                            double h, N_Vector corrected, const double* id,
                                            Mover& mover, Corrector& corrector) {
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
  point_.resize(n);
  slope_.resize(n);
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
  doubted_ = false;
  for (std::size_t i = 0; i < tangency_.rate.size(); ++i) {
    doubted_ |= tangency_.tolerance[i] == 0.0;
    const double rate = tangency_.rate[i], terms = tangency_.terms[i];
    for (std::size_t kind = 0; kind < kDoubts.size(); ++kind) {
      const RowDoubt& doubt = kDoubts[kind];
      int& seen = row_doubts_[i][kind];  // with the sign of the rate
      if (!(terms >= 0.0) || !(std::abs(rate) > doubt.share * terms) ||
          !(std::abs(rate * h) > doubt.felt * root * tangency_.tolerance[i])) {
        seen = 0;
        continue;
      }
      doubted_ = true;
      seen = rate > 0.0 ? std::max(seen, 0) + 1 : std::min(seen, 0) - 1;
      if (std::abs(seen) < doubt.steps) continue;
      seen = 0;
      std::string text = false_row(static_cast<int>(i), doubt, step, h, corrector);
      if (!text.empty()) return text;
      if (++looks_ >= kLooks) return {};
    }
  }
  return {};
}

// max(u, 0) keeps one side only: on the other there is nothing to move. point_ is the corrector's.
// Hosts that take rows out have many that vanish: they are looked at together.
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

// What is wrong with the row: dg/dt along y' and g_t by central differences of g, which know no C.
std::string FirstSteps::false_row(int row, const RowDoubt& doubt, const StepData& step, double h,
                                  Corrector& corrector) {
  const auto i = static_cast<std::size_t>(row);
  const auto size = static_cast<int>(point_.size());
  evaluator_.forget();
  plus_.resize(row_doubts_.size());
  minus_.resize(row_doubts_.size());
  moved_ = point_;
  double fastest = 1.0 / std::max(1.0, std::abs(step.t));
  for (std::size_t j = 0; j < moved_.size(); ++j)
    fastest = std::max(fastest, std::abs(slope_[j]) / std::max(1.0, std::abs(point_[j])));
  const double dt = std::cbrt(2e-16) / fastest;
  const auto difference = [&](bool along, double* slope) {
    const auto at = [&](double change, std::vector<double>& g) {
      for (std::size_t j = 0; along && j < moved_.size(); ++j)
        moved_[j] = point_[j] + change * slope_[j];
      return evaluator_.value(step.t + change, moved_.data(), size, g.data()) == Status::success;
    };
    const bool known = at(dt, plus_) && at(-dt, minus_);
    *slope = known ? (plus_[i] - minus_[i]) / (2.0 * dt) : 0.0;
    moved_ = point_;
    return known;
  };
  double along = 0.0, in_time = 0.0;
  const bool known = difference(true, &along) && difference(false, &in_time);
  if (evaluator_.fatal()) corrector.stop(-1, evaluator_.message());
  if (!known) return {};
  const double terms = tangency_.terms[i] + std::abs(in_time);
  const double felt = doubt.felt * std::sqrt(static_cast<double>(size)) * tangency_.tolerance[i];
  if (std::abs(along) > doubt.share * terms && std::abs(along * h) > felt) {
    PlainText out;
    out << "F does not keep row " << row << " (" << constraints_.name(row) << "): at t = " << step.t
        << " C y' + g_t = " << along << ", its terms sum up to " << terms << " in absolute value"
        << kRowAdvice;
    return out.str();
  }
  if (std::abs(tangency_.rate[i] + in_time - along) > doubt.share * terms &&
      searched_ + size <= kSearchLimit) {
    searched_ += size;  // C at hand may be of an earlier step: mostly nothing is wrong
    const std::string found = wrong_entry(step.t);
    if (!found.empty()) return "check_jacobian finds at t = " + brief(step.t) + ": " + found;
  }
  return {};
}

// The wrong entry of C by check_jacobian at the corrector's point; empty: none.
std::string FirstSteps::wrong_entry(double t) const {
  try {
    const JacobianReport report = check_jacobian(constraints_, t, point_, 1e-3);
    return report.correct ? std::string() : report.message;
  } catch (const std::invalid_argument&) {  // g refuses a point nearby: nothing is known
    return {};
  }
}

}  // namespace tether::ida_projection
