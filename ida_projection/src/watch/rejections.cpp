// Tether: search for the reason why IDA rejects most steps. SPDX-License-Identifier: BSD-3-Clause
#include "watch/rejections.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

// The candidate as the searches want it.
struct Point {
  std::vector<double> y, WT;

  explicit Point(const Candidate& candidate)
      : y(static_cast<std::size_t>(N_VGetLength(candidate.base))), WT(y) {
    for (std::size_t j = 0; j < y.size(); ++j) {
      const double w = candidate.weight_entries[j];
      y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
      WT[j] = w > 0.0 ? 1.0 / w : 0.0;
    }
  }
  // Most unknowns below their tolerances: the error test cannot see them.
  std::string large_tolerances() const {
    std::size_t below = 0;
    for (std::size_t j = 0; j < y.size(); ++j) below += std::abs(y[j]) < WT[j] ? 1U : 0U;
    if (2 * below <= y.size()) return {};
    return "; " + std::to_string(below) + " of " + std::to_string(y.size()) +
           " unknowns are smaller than their tolerances: reduce atol";
  }
};

}  // namespace

void RejectionWatch::count(bool moved, bool repeated, bool advances, long steps) {
  if (repeated) {
    ++rejections_;
    if (moved && std::exchange(last_refused_, steps) != steps) ++refused_steps_;
    return;
  }
  moved_in_row_ = moved ? moved_in_row_ + 1 : 0;
  standing_ = advances ? 0 : standing_ + 1;
  if (steps < window_begin_ + kWindow) return;
  if (3 * refused_steps_ > kWindow) refused_ = true;
  window_begin_ = steps;
  refused_steps_ = 0;
  if (!refused_) rejections_before_ = rejections_;
}

std::string RejectionWatch::cause(const Candidate& candidate, const StepData& step,
                                  const AlgebraicVariables& variables, Corrector& corrector,
                                  const std::string& doubt) {
  std::string text = refused_ ? "IDA rejected " + std::to_string(rejections_ - rejections_before_) +
                                    " attempts in the last " + std::to_string(kWindow) +
                                    " accepted steps before t = " + brief(step.t)
                              : "each of the last " + std::to_string(moved_in_row_) +
                                    " steps before t = " + brief(step.t) +
                                    " was moved by about what the error test allows";
  if (variables.all())
    text +=
        "; the id vector calls every variable algebraic: differential ones have to be 1 "
        "(Options::id)";
  std::string row = doubt;
  if (candidate.base_entries != nullptr) {
    const Point at(candidate);
    text += at.large_tolerances();
    if (faults_->may_search(at.y.size())) {
      const std::string entry = faults_->wrong_entry(candidate.t, at.y);
      if (!entry.empty()) row = "check_jacobian finds there: " + entry;
      if (row.empty()) {
        std::vector<double> yp(at.y);
        const double* predicted = N_VGetArrayPointer(step.yp_predicted);
        for (std::size_t j = 0; j < yp.size(); ++j)
          yp[j] = predicted[j] + step.cj * candidate.correction_entries[j];
        row = faults_->unkept(candidate.t, at.y, yp, at.WT);
      }
      if (row.empty()) row = faults_->square(candidate.t, at.y, at.WT);
      faults_->pass_end_to(corrector);
    }
  }
  if (row.empty()) row = "check the rows with check_jacobian, the id vector and the tolerances";
  return text + "; " + row;
}

// The candidate is where moves have led: y' need not fulfil F there.
const std::string& RejectionWatch::suspicion(const Candidate& candidate, Corrector& corrector,
                                             long steps) {
  if (candidate.base_entries == nullptr || std::exchange(suspected_, steps) == steps)
    return suspicion_;
  const Point at(candidate);
  const bool may_search = faults_->may_search(at.y.size());
  suspicion_.clear();
  const std::string entry = may_search ? faults_->wrong_entry(candidate.t, at.y) : std::string();
  if (!entry.empty()) return suspicion_ = "; check_jacobian finds there: " + entry;
  suspicion_ = at.large_tolerances();  // any row bends over these
  if (!suspicion_.empty() || !may_search) return suspicion_;
  const std::string square = faults_->square(candidate.t, at.y, at.WT);
  faults_->pass_end_to(corrector);
  return suspicion_ = square.empty() ? square : "; " + square;
}

}  // namespace tether::ida_projection
