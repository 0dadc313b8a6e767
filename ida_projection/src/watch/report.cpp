// Tether: status and message of the plugin. SPDX-License-Identifier: BSD-3-Clause
#include "watch/report.hpp"

#include <cstdio>

#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

// Failures in one step after which they are printed; IDA gives up after ten. More are normal in the
// first step, whose size IDA finds by trying.
constexpr int kSayAfter = 4, kSayAfterAtFirst = 8;

bool is_fatal(Status status) { return static_cast<int>(status) < 0; }

}  // namespace

int Report::finish(Status outcome, const std::string& text, long steps) {
  status = outcome;
  if (outcome == Status::success) {
    if (message != advice) message = advice;
    return 0;
  }
  message = text;
  count(outcome);
  if (is_fatal(outcome)) print_fatal(message.c_str());
  if (!is_fatal(outcome)) count_failure_in_step(text, steps);
  return is_fatal(outcome) ? kFatal : kRecoverable;
}

void Report::count(Status outcome) {
  Statistics& s = statistics_;
  switch (outcome) {
    case Status::not_converged:
      ++s.not_converged;
      break;
    case Status::move_too_long:
      ++s.move_too_long;
      break;
    case Status::inconsistent:
      ++s.inconsistent;
      break;
    case Status::not_finite:
      ++s.not_finite;
      break;
    case Status::callback_recoverable:
      ++s.callback_recoverable;
      break;
    case Status::callback_fatal:
      ++s.callback_fatal;
      break;
    default:
      break;
  }
}

int Report::caught(Status outcome, const char* text) noexcept {
  status = outcome;
  try {
    message = text;
  } catch (...) {  // no memory for the text either
    message.clear();
  }
  print_fatal(text);
  return kFatal;
}

// Once: IDA reports the failure of the run by itself.
void Report::print_fatal(const char* text) noexcept {
  if (!options_.print || printed_) return;
  printed_ = true;
  std::fprintf(stderr, "tether: %s: %s\n", to_string(status), text);
}

bool Report::says_failures(long steps) const {
  const int failures = steps == failing_step_ ? failures_in_step_ + 1 : 1;
  return failures >= (steps == 0 ? kSayAfterAtFirst : kSayAfter);
}

void Report::count_failure_in_step(const std::string& text, long steps) {
  const bool say_it = says_failures(steps) && !said_failures_;
  failures_in_step_ = steps == failing_step_ ? failures_in_step_ + 1 : 1;
  failing_step_ = steps;
  if (!say_it) return;
  said_failures_ = true;
  PlainText out;
  out << "step " << steps + 1 << " was tried " << failures_in_step_
      << " times without a point on the constraints: " << text;
  say(out.str());
}

void Report::warn(Status kind, const std::string& text, const std::string& said) {
  warning_ = text;
  warning_status_ = kind;
  const unsigned bit = 1U << static_cast<unsigned>(kind);
  if ((said_warnings_ & bit) == 0) say(said);  // not again after every IDAReInit
  said_warnings_ |= bit;
}

void Report::say(const std::string& text) const {
  if (options_.print) std::fprintf(stderr, "tether: %s\n", text.c_str());
}

void Report::reset() {
  warning_.clear();
  warning_status_ = Status::success;
  failing_step_ = -1;
}

}  // namespace tether::ida_projection
