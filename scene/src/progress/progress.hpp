// Tether: tells on stderr how far a long job is. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

namespace tether {

/// On a terminal a bar, redrawn a few times a second; otherwise a line every ten seconds.
class Progress {
 public:
  explicit Progress(double work) : all_work_(work), next_(Clock::now() + pause()) {}
  ~Progress() { hide(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A run begins, with its part of the whole work.
  void start(const std::string& what, double duration, double work) {
    run_work_ = work;
    what_ = what;
    duration_ = duration;
    at(0.0);
  }
  void at(double t) {
    share_ = t / duration_;
    const Clock::time_point now = Clock::now();
    if (now >= next_) show(now);
  }
  void finish() {
    done_work_ += run_work_;
    run_work_ = 0.0;
    at(0.0);
  }
  /// Clears the bar, so that something else can be printed.
  void hide() {
    if (terminal_) print("\r\033[K");
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr int kWidth = 30;

  std::chrono::milliseconds pause() const {
    return std::chrono::milliseconds(terminal_ ? 200 : 10000);
  }
  /// Nothing is shown on a closed stream: fmt::print would throw and end the job.
  static void print(const std::string& text) { std::fputs(text.c_str(), stderr); }
  void show(Clock::time_point now) {
    next_ = now + pause();
    const double share = std::min(1.0, (done_work_ + share_ * run_work_) / all_work_);
    if (terminal_) {
      const int filled = static_cast<int>(share * kWidth);
      print(fmt::format("\r\033[K[{:#<{}}{:<{}}] {:3.0f} %  {}", "", filled, "", kWidth - filled,
                        100.0 * share, what_));
      std::fflush(stderr);
    } else {
      print(fmt::format("{:3.0f} %  {}\n", 100.0 * share, what_));
    }
  }

  double all_work_, done_work_ = 0.0, run_work_ = 0.0;
  const bool terminal_ = isatty(STDERR_FILENO) != 0;
  double share_ = 0.0, duration_ = 1.0;
  std::string what_;
  Clock::time_point next_;
};

}  // namespace tether
