// Tether: names and work counts of what the projection does. SPDX-License-Identifier: BSD-3-Clause
#include <iomanip>
#include <limits>
#include <ostream>
#include <tether/ida_projection/statistics.hpp>

#include "host/shortest.hpp"
#include "watch/report.hpp"

namespace tether::ida_projection {

namespace {

using S = Statistics;

struct Entry {
  const char* name;
  long S::*count = nullptr;
  double S::*size = nullptr;

  constexpr Entry(const char* its_name, long S::*of) : name(its_name), count(of) {}
  constexpr Entry(const char* its_name, double S::*of) : name(its_name), size(of) {}
  double value(const S& s) const { return count ? static_cast<double>(s.*count) : s.*size; }
};
#define TETHER_ENTRIES(of)                                                                        \
  of(solver_calls), of(steps_without_plugin), of(projections), of(skipped), of(iterations),       \
      of(value_evaluations), of(jacobian_evaluations), of(joint_evaluations), of(factorizations), \
      of(refactorizations), of(extra_iterations), of(corrections_repeated), of(refreshes),        \
      of(residual_evaluations), of(rank_drops), of(untested), of(smoothing_begun),                \
      of(order_limited), of(sensitivity_projections), of(not_converged), of(move_too_long),       \
      of(moves_capped), of(inconsistent), of(not_finite), of(callback_recoverable),               \
      of(callback_fatal), of(corrector_failures), of(largest_drift_before),                       \
      of(largest_drift_after), of(largest_move), of(mean_move), of(seconds)
#define TETHER_ENTRY(name) \
  { #name, &S::name }
constexpr Entry kEntries[] = {TETHER_ENTRIES(TETHER_ENTRY)};

// The name of each status, and what counts it as a failure of a projection.
struct Outcome {
  Status status;
  const char* name;
  long Statistics::*count = nullptr;
};
constexpr Outcome outcomes[] = {
    {Status::unused, "unused"},
    {Status::success, "success"},
    {Status::not_converged, "not converged", &Statistics::not_converged},
    {Status::move_too_long, "move too long", &Statistics::move_too_long},
    {Status::inconsistent, "inconsistent constraints", &Statistics::inconsistent},
    {Status::not_finite, "not finite", &Statistics::not_finite},
    {Status::callback_recoverable, "callback failed, recoverable",
     &Statistics::callback_recoverable},
    {Status::corrector_failed, "corrector failed"},
    {Status::collapsed, "steps collapsed"},
    {Status::doubtful, "doubtful"},
    {Status::callback_fatal, "callback failed", &Statistics::callback_fatal},
    {Status::late_attach, "attached too late"},
    {Status::simultaneous_sensitivities, "simultaneous sensitivities"},
    {Status::never_called, "never called"},
    {Status::out_of_memory, "out of memory"},
    {Status::misused, "misused"},
    {Status::internal_error, "internal error"}};

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

const char* to_string(Status status) {
  for (const Outcome& outcome : outcomes)
    if (outcome.status == status) return outcome.name;
  return "unknown";
}

void count_failure(Statistics& statistics, Status status) {
  for (const Outcome& outcome : outcomes)
    if (outcome.status == status && outcome.count != nullptr) ++(statistics.*outcome.count);
}

std::string Statistics::table() const {
  PlainText out;
  out << verdict(*this) << '\n';
  for (const Entry& entry : kEntries) {
    if (entry.value(*this) == 0) continue;
    out << std::left << std::setw(24) << entry.name << " = ";
    if (entry.count)
      out << this->*entry.count << '\n';
    else
      out << std::setprecision(6) << std::scientific << this->*entry.size << '\n';
  }
  return out.str();
}

std::string Statistics::names() {
  std::string line;
  for (const Entry& entry : kEntries) line += (line.empty() ? "" : ",") + std::string(entry.name);
  return line;
}

double Statistics::number(const std::string& name) const {
  for (const Entry& entry : kEntries)
    if (name == entry.name) return entry.value(*this);
  return std::numeric_limits<double>::quiet_NaN();
}

std::ostream& operator<<(std::ostream& out, const Statistics& statistics) {
  return out << statistics.table();
}

}  // namespace tether::ida_projection
