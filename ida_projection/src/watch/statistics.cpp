// Tether: printing of the projection's work counts. SPDX-License-Identifier: BSD-3-Clause
#include <iomanip>
#include <limits>
#include <ostream>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

struct Entry {
  const char* label;   // of the table
  const char* column;  // of the CSV file
  double value;
  bool integer;
};

std::vector<Entry> entries(const Statistics& s) {
  const auto count = [](const char* label, const char* column, long value) {
    return Entry{label, column, static_cast<double>(value), true};
  };
  return {
      count("solver calls", "solver_calls", s.solver_calls),
      count("steps of IDA without the plugin", "steps_without_plugin", s.steps_without_plugin),
      count("projections", "projections", s.projections),
      count("already on the constraints", "skipped", s.skipped),
      count("Newton moves", "iterations", s.iterations),
      count("evaluations of g", "value_evaluations", s.value_evaluations),
      count("evaluations of C", "jacobian_evaluations", s.jacobian_evaluations),
      count("of both by one call", "joint_evaluations", s.joint_evaluations),
      count("factorizations of C", "factorizations", s.factorizations),
      count("factorizations of rows known to be independent", "refactorizations",
            s.refactorizations),
      count("extra corrector iterations", "extra_iterations", s.extra_iterations),
      count("corrections repeated", "corrections_repeated", s.corrections_repeated),
      count("refreshes of algebraic variables", "refreshes", s.refreshes),
      count("evaluations of F by the plugin", "residual_evaluations", s.residual_evaluations),
      count("factorizations with dropped rows", "rank_drops", s.rank_drops),
      count("algebraic variables out of the error test", "untested", s.untested),
      count("step smoothing begun", "smoothing_begun", s.smoothing_begun),
      count("order limited", "order_limited", s.order_limited),
      count("projections of sensitivities", "sensitivity_projections", s.sensitivity_projections),
      count("failures: not converged", "not_converged", s.not_converged),
      count("failures: move too long", "move_too_long", s.move_too_long),
      count("moves capped", "moves_capped", s.moves_capped),
      count("failures: rows contradict", "inconsistent", s.inconsistent),
      count("failures: not finite", "not_finite", s.not_finite),
      count("failures: callback, recoverable", "callback_recoverable", s.callback_recoverable),
      count("failures: callback, fatal", "callback_fatal", s.callback_fatal),
      count("failures of the corrector", "corrector_failures", s.corrector_failures),
      {"largest |g| before", "largest_drift_before", s.largest_drift_before, false},
      {"largest |g| after", "largest_drift_after", s.largest_drift_after, false},
      {"largest move (tolerances)", "largest_move", s.largest_move, false},
      {"mean move (tolerances)", "mean_move", s.mean_move, false},
      {"time in the projection (s)", "seconds", s.seconds, false},
  };
}

void write(std::ostream& out, const Entry& entry) {
  if (entry.integer)
    out << static_cast<long>(entry.value);
  else
    out << std::setprecision(6) << std::scientific << entry.value << std::defaultfloat;
}

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
  for (const Entry& entry : entries(*this)) {
    if (entry.value == 0) continue;
    out << std::left << std::setw(34) << entry.label << " = ";
    write(out, entry);
    out << '\n';
  }
  return out.str();
}

std::string Statistics::csv_header() {
  std::string line;
  for (const Entry& entry : entries(Statistics{}))
    line += (line.empty() ? "" : ",") + std::string(entry.column);
  return line;
}

double Statistics::number(const std::string& column) const {
  for (const Entry& entry : entries(*this))
    if (column == entry.column) return entry.value;
  return std::numeric_limits<double>::quiet_NaN();
}

std::string Statistics::csv_row() const {
  PlainText out;
  const char* separator = "";
  for (const Entry& entry : entries(*this)) {
    out << separator;
    write(out, entry);
    separator = ",";
  }
  return out.str();
}

std::ostream& operator<<(std::ostream& out, const Statistics& statistics) {
  return out << statistics.table();
}

}  // namespace tether::ida_projection
