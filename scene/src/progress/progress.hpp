// Tether: tells on stderr how far a long job is. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <string>

namespace tether {

/// On a terminal a bar, redrawn a few times a second; otherwise a line every ten seconds.
class Progress {
 public:
  explicit Progress(double work);
  ~Progress() { hide(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A run begins, with its part of the whole work.
  void start(const std::string& what, double duration, double work);
  void at(double t);
  void finish();
  /// Clears the bar, so that something else can be printed.
  void hide();

 private:
  using Clock = std::chrono::steady_clock;
  void show(Clock::time_point now);

  double all_work_, done_work_ = 0.0, run_work_ = 0.0;
  bool terminal_;
  double share_ = 0.0, duration_ = 1.0;
  std::string what_;
  Clock::time_point next_;
};

}  // namespace tether
