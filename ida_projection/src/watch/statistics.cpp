// Tether: printing of the projection's work counts. SPDX-License-Identifier: BSD-3-Clause
#include <iomanip>
#include <limits>
#include <ostream>
#include <tether/ida_projection/statistics.hpp>

#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

using S = Statistics;

struct Entry {
  const char* name;
  long S::*count;
  double S::*size = nullptr;

  double value(const S& s) const { return count ? static_cast<double>(s.*count) : s.*size; }
  void write(std::ostream& out, const S& s) const {
    if (count)
      out << s.*count;
    else
      out << std::setprecision(6) << std::scientific << s.*size << std::defaultfloat;
  }
};
constexpr Entry kEntries[] = {{"solver_calls", &S::solver_calls},
                              {"steps_without_plugin", &S::steps_without_plugin},
                              {"projections", &S::projections},
                              {"skipped", &S::skipped},
                              {"iterations", &S::iterations},
                              {"value_evaluations", &S::value_evaluations},
                              {"jacobian_evaluations", &S::jacobian_evaluations},
                              {"joint_evaluations", &S::joint_evaluations},
                              {"factorizations", &S::factorizations},
                              {"refactorizations", &S::refactorizations},
                              {"extra_iterations", &S::extra_iterations},
                              {"corrections_repeated", &S::corrections_repeated},
                              {"refreshes", &S::refreshes},
                              {"residual_evaluations", &S::residual_evaluations},
                              {"rank_drops", &S::rank_drops},
                              {"untested", &S::untested},
                              {"smoothing_begun", &S::smoothing_begun},
                              {"order_limited", &S::order_limited},
                              {"sensitivity_projections", &S::sensitivity_projections},
                              {"not_converged", &S::not_converged},
                              {"move_too_long", &S::move_too_long},
                              {"moves_capped", &S::moves_capped},
                              {"inconsistent", &S::inconsistent},
                              {"not_finite", &S::not_finite},
                              {"callback_recoverable", &S::callback_recoverable},
                              {"callback_fatal", &S::callback_fatal},
                              {"corrector_failures", &S::corrector_failures},
                              {"largest_drift_before", nullptr, &S::largest_drift_before},
                              {"largest_drift_after", nullptr, &S::largest_drift_after},
                              {"largest_move", nullptr, &S::largest_move},
                              {"mean_move", nullptr, &S::mean_move},
                              {"seconds", nullptr, &S::seconds}};

// The numbers together, in one line. A mean move of a tolerance is as long as an error
// that IDA's test accepts: constraints that F keeps need less.
std::string verdict(const Statistics& s) {
  if (s.solver_calls == 0)
    return "IDA has not called the plugin. If IDASolve was called, another nonlinear solver was "
           "attached after it.";
  if (s.steps_without_plugin > 0)
    return "IDA took steps without the plugin: another nonlinear solver was attached after it.";
  PlainText out;
  out << std::setprecision(2);
  if (s.projections == 0)
    out << "No step needed a projection: IDA kept the constraints.";
  else if (s.mean_move > 1)
    out << "F and the constraints may not belong together: steps were moved by " << s.mean_move
        << " tolerances in the mean.";
  else
    out << "The constraints hold: |g| is at most " << s.largest_drift_after
        << ", steps were moved by " << s.mean_move << " tolerances in the mean.";
  if (s.untested > 0)
    out << " Out of the error test are " << s.untested
        << " algebraic variables, whose values between steps have no tolerance.";
  if (s.failures() > 0) out << " Attempts that failed and were repeated: " << s.failures() << ".";
  return out.str();
}

}  // namespace

std::string Statistics::table() const {
  PlainText out;
  out << verdict(*this) << '\n';
  for (const Entry& entry : kEntries) {
    if (entry.value(*this) == 0) continue;
    out << std::left << std::setw(24) << entry.name << " = ";
    entry.write(out, *this);
    out << '\n';
  }
  return out.str();
}

std::string Statistics::csv_header() {
  std::string line;
  for (const Entry& entry : kEntries) line += (line.empty() ? "" : ",") + std::string(entry.name);
  return line;
}

double Statistics::number(const std::string& column) const {
  for (const Entry& entry : kEntries)
    if (column == entry.name) return entry.value(*this);
  return std::numeric_limits<double>::quiet_NaN();
}

std::string Statistics::csv_row() const {
  PlainText out;
  for (const Entry& entry : kEntries) {
    if (&entry != kEntries) out << ',';
    entry.write(out, *this);
  }
  return out.str();
}

std::ostream& operator<<(std::ostream& out, const Statistics& statistics) {
  return out << statistics.table();
}

}  // namespace tether::ida_projection
