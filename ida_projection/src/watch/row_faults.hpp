// Tether: faults of rows and tolerances (method, section 9). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "constraints/evaluator.hpp"
#include "host/corrector.hpp"
#include "host/rounding.hpp"
#include "host/shortest.hpp"
#include "movers/rows_at.hpp"
#include "start/algebraic.hpp"
#include "start/linear_system.hpp"
#include "step/attempt.hpp"

namespace tether::ida_projection {

/// Wrong entries of C, rows that F does not keep, that hold one side of their set or depend on each
/// other, and tolerances above the solution; on contiguous vectors. Texts name the fault; empty:
/// none was found, or g is not known there.
class RowFaults {
 public:
  RowFaults(const Constraints& constraints, Statistics& statistics)
      : constraints_(constraints), evaluator_(constraints, statistics) {}

  /// A new run starts.
  void reset() {
    run_ = Run();
    run_.rows.resize(static_cast<std::size_t>(constraints_.total_count()));
  }
  /// Whether check() is due in the step after `steps` accepted ones: not while y' is that of the
  /// start.
  static bool are_checked(long steps) {
    return steps >= 2 && (steps <= kFirstSteps || steps % kMeasureEvery == 0);
  }
  /// After a successful move; `corrected`: the corrector's ycor.
  std::string check(const Candidate& candidate, const Attempt& attempt, N_Vector corrected,
                    const AlgebraicVariables& variables, RowsAt& rows, Corrector& corrector) {
    Corrected at{candidate, attempt, corrected, attempt.h, nullptr, corrector};
    std::string found = compare_with_tolerances(at);
    // In forms of index 2 and more y' and multipliers carry the error of derivatives that F lacks.
    if (!found.empty() || variables.high_index() || !variables.index_known()) return found;
    const long steps = attempt.steps, allowed = 20 + steps / 100;
    if ((steps <= kFirstSteps && steps % 2 != 0) || run_.checks >= allowed ||
        candidate.base_entries == nullptr || !has_values(constraints_))
      return found;
    at.id = variables.mask();
    at.span *= static_cast<double>(std::max(1L, steps - std::exchange(run_.last_check, steps)));
    return find_false_rows(at, rows);
  }
  /// Whether a row was named that F does not keep.
  bool false_row_found() const { return run_.false_row_found; }
  /// Names a row that would move only algebraic variables that F determines; empty: there is none.
  const std::string& idle_row() const { return run_.idle_row; }

  /// Names the entry of C that check_jacobian finds wrong, with the reason where that is a kink.
  std::string wrong_entry(double t, const std::vector<double>& y) const {
    if (!has_values(constraints_) || y.size() > static_cast<std::size_t>(kLargestProbed)) return {};
    try {
      const JacobianReport report = check_jacobian(constraints_, t, y, 1e-3);
      return report.correct ? std::string() : report.message;
    } catch (const std::exception&) {  // g refuses a point nearby: nothing is known
      return {};
    }
  }
  /// Names the rows whose gradients, in tolerances WT, depend on each other.
  std::vector<std::string> dependent(double t, const std::vector<double>& y,
                                     const std::vector<double>& WT) {
    if (!has_values(constraints_) || y.size() > static_cast<std::size_t>(kLargestProbed)) return {};
    const auto n = static_cast<Eigen::Index>(y.size());
    Eigen::MatrixXd C(n, evaluator_.rows());  // transposed
    std::vector<int> columns(y.size());
    std::iota(columns.begin(), columns.end(), 0);
    if (evaluator_.jacobian(t, y.data(), static_cast<int>(n), WT.data(), columns, C.data()) !=
        Status::success)
      return {};
    C.array().colwise() *= Eigen::Map<const Eigen::ArrayXd>(WT.data(), n);
    const std::vector<char> found = undetermined_columns(std::move(C), false);
    std::vector<std::string> names;
    for (std::size_t i = 0; i < found.size(); ++i)
      if (found[i]) names.push_back(constraints_.name(static_cast<int>(i)));
    return names;
  }

 private:
  static constexpr long kFirstSteps = 100;   // accepted ones, in which all of this is looked for
  static constexpr double kOffItsSet = 2.0;  // tolerances: F has moved a row so far off its set
  static constexpr double kAgree = 0.5;      // of this, to confirm it; of a rate, its next change
  static constexpr int kSeen = 3;  // times, before a vanished row or a small solution is said

  // An attempt as the corrector left it.
  struct Corrected {
    const Candidate& candidate;
    const Attempt& attempt;
    N_Vector ycor;
    double span;  // of time, since the last check
    const double* id;
    Corrector& corrector;
  };
  struct Row {
    double sum = 0.0, span = 0.0;  // of C y' over time, and the time
    double verified = 0.0;         // what a better y' left of the sums so far
    double suspected = 0.0;        // rate that verified them at the last check; 0: none did
    double limit = 1.0;            // of the sum from which on it is verified
    int vanished = 0;              // steps in which its gradient was zero
  };
  struct Run {
    std::vector<Row> rows;
    long checks = 0, last_check = 2;  // into doubts in rows; the steps at the last one
    int small_solutions = 0;          // at a solution below its tolerances
    double largest = 0.0;             // size of the solution so far, in tolerances
    bool false_row_found = false;
    std::string idle_row;
    std::size_t searched = 0;  // unknowns compared
  };

  // If |y| is below a tolerance in the norm of the error test, y = 0 would pass the test as well. A
  // solution that has decayed, rests or grows from zero is no fault of the tolerances.
  std::string compare_with_tolerances(const Corrected& at) {
    if (!(run_.largest < 1.0) || at.attempt.steps > kFirstSteps) return {};
    N_Vector weights = at.candidate.weights;
    if (!work_) work_ = OwnedVector(weights);
    N_VLinearSum(1.0, at.candidate.base, 1.0, at.ycor, work_);
    const double size = N_VWrmsNorm(work_, weights);
    N_VLinearSum(1.0, at.candidate.predicted_slope, at.attempt.cj, at.ycor, work_);
    const double change = std::abs(at.span) * N_VWrmsNorm(work_, weights);
    const bool grows = size > 1.02 * run_.largest;
    run_.largest = std::max(run_.largest, size);
    const bool rests = !(change > 0.05 * size);
    if (!(size < 1.0) || grows || rests) return {};
    if (++run_.small_solutions != kSeen) return {};
    return "the whole solution is " + brief(size) +
           " tolerances long at t = " + brief(at.attempt.t) +
           ", so that IDA's error test cannot see it: reduce atol";
  }
  // Tests C y' + g_t = 0 at the corrector's point, where y' satisfies F. C y' costs a product with
  // the present C; g is evaluated only for a row that stands out.
  std::string find_false_rows(const Corrected& at, RowsAt& rows) {
    const auto n = static_cast<std::size_t>(N_VGetLength(at.candidate.base));
    if (point_.size() != n) {  // all that a comparison needs, so that none allocates
      for (std::vector<double>* y : {&point_, &slope_, &better_, &better_p_, &moved_}) y->resize(n);
      for (std::vector<double>* g :
           {&here_, &sides_[0], &sides_[1], &sides_[2], &sides_[3], &rates_})
        g->resize(run_.rows.size());
      for (OwnedVector* each : {&work_, &ycor_}) *each = OwnedVector(at.candidate.base);
      evaluator_.reserve(static_cast<int>(n));
    }
    if (rows.age > 0) return {};
    const double* predicted = N_VGetArrayPointer(at.candidate.predicted_slope);
    const double* ycor = N_VGetArrayPointer(at.ycor);
    for (std::size_t j = 0; j < n; ++j) {
      point_[j] = at.candidate.base_entries[j] + ycor[j];
      slope_[j] = predicted[j] + at.attempt.cj * ycor[j];
    }
    if (!rows.tangency(slope_, at.id, tangency_)) return {};
    std::string text = find_one_sided_row(at.attempt.t);
    const double root = std::sqrt(static_cast<double>(n));
    for (std::size_t i = 0; i < tangency_.rate.size() && text.empty(); ++i) {
      if (tangency_.terms[i] < 0.0 && tangency_.size[i] == 0.0 && run_.idle_row.empty())
        run_.idle_row = name_of(i) +
                        " has algebraic variables only, which F determines by itself: it moves "
                        "nothing else and may be left out";
      if (!(tangency_.terms[i] >= 0.0)) continue;
      Row& row = run_.rows[i];
      row.sum += tangency_.rate[i] * at.span;
      row.span += at.span;
      const double noticed = kOffItsSet * root * tangency_.tolerance[i];
      if (!(std::abs(row.sum) > row.limit * noticed) && row.suspected == 0.0) continue;
      text = diagnose(i, noticed, at);
      if (evaluator_.report.fatal) at.corrector.stop(-1, evaluator_.report.text);
      evaluator_.report.fatal = false;
      row.sum = row.span = 0.0;
      row.limit *= 2.0;  // what was noise is so again
      ++run_.checks;
    }
    return text;
  }
  // Finds a row such as max(u, 0), which is zero on one side of its set: constant to one side along
  // some direction, and not to the other. Hosts that switch rows off have many that vanish; all are
  // tested together, along two directions of no structure.
  std::string find_one_sided_row(double t) {
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < tangency_.tolerance.size(); ++i)
      if (tangency_.tolerance[i] == 0.0 && ++run_.rows[i].vanished == kSeen) rows.push_back(i);
    if (rows.empty() || !value(t, point_, here_)) return {};
    for (const double turn : {3.7, 1.3}) {
      for (const int side : {0, 1}) {
        for (std::size_t j = 0; j < moved_.size(); ++j)
          moved_[j] = point_[j] + (1 - 2 * side) * kWideIncrement *
                                      std::max(1.0, std::abs(point_[j])) *
                                      std::sin(1.0 + turn * static_cast<double>(j));
        if (!value(t, moved_, sides_[side])) return {};
      }
      for (const std::size_t i : rows) {
        const double ahead = std::abs(sides_[0][i] - here_[i]);
        const double behind = std::abs(sides_[1][i] - here_[i]);
        if (ahead != behind && 10.0 * std::min(ahead, behind) <= std::max(ahead, behind))
          return name_of(i) +
                 " and its gradient vanish to one side of the set; its slopes to both sides differ "
                 "there: a row with |.| or max has no derivative on the set, write it without";
      }
    }
    return {};
  }
  std::string name_of(std::size_t row) const {
    const int i = static_cast<int>(row);
    return "row " + std::to_string(i) + " (" + constraints_.name(i) + ")";
  }
  // Largest relative rate of an unknown, or of t.
  static double fastest(double t, const std::vector<double>& y, const std::vector<double>& yp) {
    double rate = 1.0 / std::max(1.0, std::abs(t));
    for (std::size_t j = 0; j < y.size(); ++j)
      rate = std::max(rate, std::abs(yp[j]) / std::max(1.0, std::abs(y[j])));
    return rate;
  }
  // Refines y' by one iteration for F at better_. It then contains neither the rest that IDA's
  // convergence test allows nor the distance from the constraints. ycor_ begins as the corrector's.
  bool refine_slope(const Corrected& at) {
    double* const correction = N_VGetArrayPointer(ycor_);
    const auto base = [&](std::size_t j) { return better_[j] - correction[j]; };
    if (at.corrector.residual_with(at.candidate, base, ycor_, work_) != 0) return false;
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
  // The fault of row i.
  std::string diagnose(std::size_t i, double noticed, const Corrected& at) {
    const double t = at.attempt.t;
    const auto rate_along = [&](const std::vector<double>& y, const std::vector<double>& yp) {
      return rates(t, y, yp) ? rates_[i] : 0.0;
    };
    better_p_ = slope_;
    for (std::size_t j = 0; j < better_.size(); ++j)
      better_[j] = at.candidate.base_entries[j] + at.candidate.correction_entries[j];
    N_VScale(1.0, at.ycor, ycor_);
    double before = 0.0, along = 0.0;
    for (const bool measures : {false, true, true}) {
      if (!refine_slope(at)) return {};
      if (measures) before = std::exchange(along, rate_along(better_, better_p_));
    }
    // Differences of g know less than a 1e-9th of its terms.
    const double rounding = 1e-9 * tangency_.size[i] * fastest(t, better_, better_p_);
    Row& of = run_.rows[i];
    const bool settled =
        std::abs(along) > rounding && std::abs(along - before) <= 0.01 * std::abs(along);
    if (settled) of.verified += along * of.span;
    const double earlier = std::exchange(of.suspected, 0.0);
    if (settled && std::abs(of.verified) > kAgree * noticed) of.suspected = along;
    // At a singular position F determines no y', whatever the sum: the next check decides.
    if (std::abs(earlier - of.suspected) < kAgree * std::abs(of.suspected)) {
      run_.false_row_found = true;
      return "F does not keep " + name_of(i) + ": at t = " + brief(t) +
             " C y' + g_t = " + brief(along) +
             "; check the row, its constants and F, or give also the rows without which F does not "
             "keep it";
    }
    std::fill(better_p_.begin(), better_p_.end(), 0.0);
    const double with_C = tangency_.rate[i] + rate_along(point_, better_p_);
    run_.searched += point_.size();
    if (run_.searched > static_cast<std::size_t>(kLargestProbed) ||
        std::abs(with_C - rate_along(point_, slope_)) <= 1e-2 * tangency_.terms[i])
      return {};
    const std::string found = wrong_entry(t, point_);  // the present C may be of an earlier step
    return found.empty() ? found : "check_jacobian finds at t = " + brief(t) + ": " + found;
  }
  bool value(double t, const std::vector<double>& y, std::vector<double>& g) {
    return evaluator_.value(t, y.data(), static_cast<int>(y.size()), g.data()) == Status::success;
  }
  // rates_ <- dg/dt of each row along y' by differences of g, independent of C, to either side.
  // If F jumps, a row that it keeps has a kink, and only one side agrees. 0 where the sides
  // contradict. False: g is not known.
  bool rates(double t, const std::vector<double>& y, const std::vector<double>& yp) {
    const double dt = std::cbrt(2e-16) / fastest(t, y, yp);
    const auto at = [&](double time, std::vector<double>& g) {
      for (std::size_t j = 0; j < y.size(); ++j) moved_[j] = y[j] + time * yp[j];
      return value(t + time, moved_, g);
    };
    if (!at(0.0, here_) || !at(dt, sides_[0]) || !at(2.0 * dt, sides_[1]) || !at(-dt, sides_[2]) ||
        !at(-2.0 * dt, sides_[3]))
      return false;
    for (std::size_t i = 0; i < rates_.size(); ++i) {
      const auto slope = [&](int side, double reach) {
        return (4.0 * sides_[side][i] - sides_[side + 1][i] - 3.0 * here_[i]) / (2.0 * reach);
      };
      const double ahead = slope(0, dt), behind = slope(2, -dt);
      rates_[i] = !(ahead * behind > 0.0)              ? 0.0
                  : std::abs(ahead) < std::abs(behind) ? ahead
                                                       : behind;
    }
    return true;
  }

  const Constraints& constraints_;
  Evaluator evaluator_;
  Run run_;
  Tangency tangency_;                      // of the caller's rows
  std::vector<double> point_, slope_;      // y and y' as the corrector left them
  std::vector<double> better_, better_p_;  // the same, nearer to what F asks for
  std::vector<double> moved_, here_, sides_[4], rates_;
  OwnedVector work_, ycor_;
};

}  // namespace tether::ida_projection
