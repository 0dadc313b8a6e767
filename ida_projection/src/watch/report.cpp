// Tether: status and message of the plugin. SPDX-License-Identifier: BSD-3-Clause
#include "watch/report.hpp"

#include <cstdio>
#include <utility>

namespace tether::ida_projection {

namespace {

bool is_fatal(Status status) { return static_cast<int>(status) < 0; }

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

}  // namespace

const char* to_string(Status status) {
  for (const Outcome& outcome : outcomes)
    if (outcome.status == status) return outcome.name;
  return "unknown";
}

int Report::finish(Status outcome, const std::string& text, long steps) {
  if (outcome == Status::success) return succeed();
  for (const Outcome& counted : outcomes)
    if (counted.status == outcome && counted.count != nullptr) ++(statistics_.*counted.count);
  if (is_fatal(outcome)) return caught(outcome, text.c_str());
  status = outcome;
  message = text;
  const bool prints = prints_failures(steps);
  failures_in_step_ = steps == failing_step_ ? failures_in_step_ + 1 : 1;
  failing_step_ = steps;
  if (prints && first_of(Status::not_converged))
    print("step " + std::to_string(steps + 1) + " was tried " + std::to_string(failures_in_step_) +
          " times without a point on the constraints: " + text);
  return kRecoverable;
}

int Report::caught(Status outcome, const char* text) noexcept {
  status = outcome;
  try {
    message = text;
  } catch (...) {  // no memory for the text either
    message.clear();
  }
  // Once: IDA reports the failure of the run by itself.
  if (options_.print && first_of(Status::callback_fatal))
    std::fprintf(stderr, "tether: %s: %s\n", to_string(status), text);
  return kFatal;
}

bool Report::prints_failures(long steps) const {
  const int failures = steps == failing_step_ ? failures_in_step_ + 1 : 1;
  // More are normal in the first step, whose size IDA finds by trying.
  return failures >= (steps == 0 ? 2 * kSayAfter : kSayAfter);
}

void Report::warn(Status kind, const std::string& text) {
  warning_ = text + (warning_.empty() ? "" : "; " + warning_);
  warning_status_ = kind;
  if (first_of(kind)) print(text);
}

// Whether nothing of this kind was printed yet: not again after every IDAReInit. A bit for each
// kind, one for all that end the run.
bool Report::first_of(Status kind) noexcept {
  const unsigned bit = 1U << static_cast<unsigned>(is_fatal(kind) ? Status::unused : kind);
  return (std::exchange(printed_kinds_, printed_kinds_ | bit) & bit) == 0;
}

void Report::print(const std::string& text) const {
  if (options_.print) std::fprintf(stderr, "tether: %s\n", text.c_str());
}

void Report::reset() {
  warning_.clear();
  warning_status_ = Status::success;
  failing_step_ = -1;
}

}  // namespace tether::ida_projection
