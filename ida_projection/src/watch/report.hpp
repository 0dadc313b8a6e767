// Tether: status and message of the plugin; each warning is printed once.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <string>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <utility>

#include "host/guarded.hpp"

namespace tether::ida_projection {

/// Counts an outcome that is a failure of a projection.
void count_failure(Statistics& statistics, Status status);

/// Outcomes of solves, counted in the statistics; what Projection::status() and message() tell.
class Report {
 public:
  /// Failures in a row after which their cause is told; IDA gives up after ten.
  static constexpr int kSayAfter = 4;

  Report(const Options& options, Statistics& statistics)
      : options_(options), statistics_(statistics) {}

  Status status = Status::unused;
  std::string message;
  std::string advice;  ///< what message() says while nothing is wrong

  /// Status, text and count of an outcome in the attempt at the step after `steps`; the code that
  /// IDA wants.
  int finish(Status outcome, const std::string& text, long steps) {
    if (outcome == Status::success) return succeed();
    count_failure(statistics_, outcome);
    if (is_fatal(outcome)) return caught(outcome, text.c_str());
    status = outcome;
    message = text;
    const bool prints = prints_failures(steps);
    failures_in_step_ = steps == failing_step_ ? failures_in_step_ + 1 : 1;
    failing_step_ = steps;
    if (prints && first_of(Status::not_converged))
      print("step " + std::to_string(steps + 1) + " was tried " +
            std::to_string(failures_in_step_) +
            " times without a point on the constraints: " + text);
    return kRecoverable;
  }
  /// The same for success, of which the message is the advice.
  int succeed() {
    status = Status::success;
    if (message != advice) message = advice;
    return 0;
  }
  void advise(const std::string& text) {
    if (!text.empty()) advice = text;
  }
  /// The same for an exception, which must not pass through IDA's C functions.
  int caught(Status outcome, const char* text) noexcept {
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
  /// Whether the next failure in the step after `steps` is printed.
  bool prints_failures(long steps) const {
    const int failures = steps == failing_step_ ? failures_in_step_ + 1 : 1;
    // More are normal in the first step, whose size IDA finds by trying.
    return failures >= (steps == 0 ? 2 * kSayAfter : kSayAfter);
  }
  /// Keeps and prints the reason why IDA rejects most steps or results are doubtful. An earlier
  /// doubt follows, without being printed again.
  void warn(Status kind, const std::string& text) {
    warning_ = text + (warning_.empty() ? "" : "; " + warning_);
    warning_status_ = kind;
    if (first_of(kind)) print(text);
  }
  /// Prints on stderr if Options::print is set.
  void print(const std::string& text) const {
    if (options_.print) std::fprintf(stderr, "tether: %s\n", text.c_str());
  }
  /// A new run starts.
  void reset() {
    warning_.clear();
    warning_status_ = Status::success;
    failing_step_ = -1;
  }

  /// Ends the run with the warning as its reason; the code that IDA wants.
  int end(Status kind) {
    status = kind;
    message = warning_;
    return kFatal;
  }
  Status warning() const { return warning_status_; }
  Status status_or_warning() const { return status == Status::success ? warning_status_ : status; }
  const std::string& text() const { return message.empty() ? warning_ : message; }

 private:
  static bool is_fatal(Status status) { return static_cast<int>(status) < 0; }
  // Whether nothing of this kind was printed yet: not again after every IDAReInit. A bit for each
  // kind, one for all that end the run.
  bool first_of(Status kind) noexcept {
    const unsigned bit = 1U << static_cast<unsigned>(is_fatal(kind) ? Status::unused : kind);
    return (std::exchange(printed_kinds_, printed_kinds_ | bit) & bit) == 0;
  }

  const Options& options_;
  Statistics& statistics_;
  std::string warning_;
  Status warning_status_ = Status::success;
  unsigned printed_kinds_ = 0;
  long failing_step_ = -1;
  int failures_in_step_ = 0;
};

}  // namespace tether::ida_projection
