// Tether: search for the reason why IDA rejects most steps.
// SPDX-License-Identifier: BSD-3-Clause
#include "watch/collapse.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "host/shortest.hpp"
#include "watch/first_steps.hpp"
#include "watch/kink.hpp"

namespace tether::ida_projection {

namespace {

constexpr long kWindow = 200;         // accepted steps
constexpr int kLargestSearch = 2000;  // unknowns up to which columns are looked at one by one

// Most unknowns below their tolerances: the error test cannot see them.
std::string large_tolerances(const Candidate& candidate) {
  const auto size = static_cast<int>(N_VGetLength(candidate.base));
  int below = 0;
  for (int j = 0; j < size; ++j) {
    const double y = candidate.base_entries[j] + candidate.correction_entries[j];
    below += std::abs(y) * candidate.weight_entries[j] < 1.0 ? 1 : 0;
  }
  if (2 * below <= size) return {};
  PlainText out;
  out << "; " << below << " of " << size
      << " unknowns are smaller than their tolerances: reduce atol";
  return out.str();
}

}  // namespace

void RejectionWatch::reset() {
  moved_in_row_ = standing_ = rejections_ = rejections_before_ = window_begin_ = refused_steps_ = 0;
  rejected_in_step_ = collapsed_ = false;
}

void RejectionWatch::count(bool moved, bool repeated, bool advances, long steps) {
  if (repeated) {
    ++rejections_;
    rejected_in_step_ |= moved;
    return;
  }
  moved_in_row_ = moved ? moved_in_row_ + 1 : 0;
  standing_ = advances ? 0 : standing_ + 1;
  if (rejected_in_step_) ++refused_steps_;
  rejected_in_step_ = false;
  if (steps < window_begin_ + kWindow) return;
  if (3 * refused_steps_ > kWindow) collapsed_ = true;
  window_begin_ = steps;
  refused_steps_ = 0;
  if (!collapsed_) rejections_before_ = rejections_;
}

std::string RejectionWatch::cause(const Candidate& candidate, const StepData& step,
                                  const AlgebraicVariables& variables, Corrector& corrector,
                                  const std::string& doubt) const {
  PlainText out;
  if (collapsed_)
    out << "IDA rejected " << rejections_ - rejections_before_ << " attempts in the last "
        << kWindow << " accepted steps before t = " << step.t;
  else
    out << "each of the last " << moved_in_row_ << " steps before t = " << step.t
        << " was moved by about what the error test allows";
  if (variables.all())
    out << "; the id vector calls every variable algebraic: differential ones have to be 1 "
           "(Options::id)";
  const bool contiguous = candidate.base_entries != nullptr;
  if (contiguous) out << large_tolerances(candidate);
  std::string row = contiguous ? wrong_entry(candidate) : std::string();
  if (row.empty()) row = doubt;
  if (row.empty() && contiguous) row = suspected_row(candidate, step);
  if (row.empty() && contiguous) row = squared_row(candidate, corrector);
  if (row.empty())
    out << "; check the rows with check_jacobian, the id vector and the tolerances";
  else
    out << "; " << row;
  return out.str();
}

// At the candidate, which moves have changed, y' need not satisfy F.
std::string RejectionWatch::suspicion(const Candidate& candidate, Corrector& corrector) const {
  if (candidate.base_entries == nullptr) return {};
  std::string found = wrong_entry(candidate);
  if (!found.empty()) return "; " + found;
  if (!(found = large_tolerances(candidate)).empty()) return found;  // any row bends over these
  found = squared_row(candidate, corrector);
  return found.empty() ? found : "; " + found;
}

// Finds a row that is a square: Newton's move for it alone leaves a fourth of g.
std::string RejectionWatch::squared_row(const Candidate& candidate, Corrector& corrector) const {
  const auto size = static_cast<int>(N_VGetLength(candidate.base));
  if (!has_values(constraints_) || size > kLargestSearch) return {};
  const auto n = static_cast<std::size_t>(size);
  Statistics ignored;
  Evaluator evaluator(constraints_, ignored);
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
  if (evaluator.value(t, y.data(), size, g.data()) == Status::success &&
      evaluator.jacobian(t, y.data(), size, WT.data(), columns, C.data()) == Status::success)
    for (std::size_t i = 0; i < m && found.empty(); ++i) {
      double square = 0.0;
      for (std::size_t j = 0; j < n; ++j) square += std::pow(C[i * n + j] * WT[j], 2);
      if (!(square > 0.0) || g[i] == 0.0) continue;
      std::vector<double> moved = y;
      for (std::size_t j = 0; j < n; ++j) moved[j] -= g[i] / square * C[i * n + j] * WT[j] * WT[j];
      if (evaluator.value(t, moved.data(), size, left.data()) != Status::success) continue;
      if (std::abs(left[i] / g[i] - 0.25) < 0.05)
        found = "row " + std::to_string(i) + " (" + constraints_.name(static_cast<int>(i)) +
                ") looks like a square: Newton's move leaves a fourth of g, as at a double root; "
                "write it without the square";
    }
  if (evaluator.fatal()) corrector.stop(-1, evaluator.message());
  return found;
}

// Finds a wrong entry of C by differences of g.
std::string RejectionWatch::wrong_entry(const Candidate& candidate) const {
  const auto length = static_cast<int>(N_VGetLength(candidate.base));
  if (!has_values(constraints_) || length > kLargestSearch) return {};
  std::vector<double> y(static_cast<std::size_t>(length));
  for (std::size_t j = 0; j < y.size(); ++j)
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
  const std::string found = ida_projection::wrong_entry(constraints_, candidate.t, y);
  return found.empty() ? found : "check_jacobian finds there: " + found;
}

// Finds a row that F does not keep, by C y' + g_t from differences of g.
std::string RejectionWatch::suspected_row(const Candidate& candidate, const StepData& step) const {
  const auto length = static_cast<int>(N_VGetLength(candidate.base));
  if (!has_values(constraints_) || length > kLargestSearch) return {};
  const auto n = static_cast<std::size_t>(length);
  std::vector<double> y(n), yp(n);
  const double* predicted = N_VGetArrayPointer(step.yp_predicted);
  for (std::size_t j = 0; j < n; ++j) {
    y[j] = candidate.base_entries[j] + candidate.correction_entries[j];
    yp[j] = predicted[j] + step.cj * candidate.correction_entries[j];
  }
  Statistics ignored;
  Evaluator evaluator(constraints_, ignored);
  const auto m = static_cast<std::size_t>(evaluator.rows());
  std::vector<double> plus(m), minus(m), rate(m, 0.0), size(m, 0.0);
  const double h = std::cbrt(2e-16);
  for (std::size_t j = 0; j <= n; ++j) {  // the last one is t
    const double change = h * std::max(1.0, std::abs(j < n ? y[j] : candidate.t));
    const double speed = j < n ? yp[j] : 1.0;
    const auto at = [&](double moved, std::vector<double>& g) {
      const double kept = j < n ? y[j] : 0.0;
      if (j < n) y[j] += moved;
      const double t = candidate.t + (j < n ? 0.0 : moved);
      const bool known = evaluator.value(t, y.data(), length, g.data()) == Status::success;
      if (j < n) y[j] = kept;
      return known;
    };
    if (!at(change, plus) || !at(-change, minus)) return {};
    for (std::size_t i = 0; i < m; ++i) {
      const double term = (plus[i] - minus[i]) / (2.0 * change) * speed;
      rate[i] += term;
      size[i] += std::abs(term);
    }
  }
  std::size_t worst = 0;
  for (std::size_t i = 0; i < m; ++i)
    if (std::abs(rate[i]) * size[worst] > std::abs(rate[worst]) * size[i]) worst = i;
  if (!(std::abs(rate[worst]) > kNoInvariant * size[worst])) return {};
  PlainText out;
  out << "F does not keep row " << worst << " (" << constraints_.name(static_cast<int>(worst))
      << "): C y' + g_t = " << rate[worst] << ", its terms sum up to " << size[worst]
      << " in absolute value" << kRowAdvice;
  return out.str();
}

}  // namespace tether::ida_projection
