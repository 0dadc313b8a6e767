// Tether: status and message of the plugin; each warning is printed once.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>

#include "host/guarded.hpp"

namespace tether::ida_projection {

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
  int finish(Status outcome, const std::string& text, long steps);
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
  int caught(Status outcome, const char* text) noexcept;
  /// Whether the next failure in the step after `steps` is printed.
  bool prints_failures(long steps) const;
  /// Keeps and prints the reason why IDA rejects most steps or results are doubtful. An earlier
  /// doubt follows, without being printed again.
  void warn(Status kind, const std::string& text);
  /// Prints on stderr if Options::print is set.
  void print(const std::string& text) const;
  /// A new run starts.
  void reset();

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
  bool first_of(Status kind) noexcept;

  const Options& options_;
  Statistics& statistics_;
  std::string warning_;
  Status warning_status_ = Status::success;
  unsigned printed_kinds_ = 0;
  long failing_step_ = -1;
  int failures_in_step_ = 0;
};

}  // namespace tether::ida_projection
