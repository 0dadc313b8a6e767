// Tether: tells on stderr how far a long job is. SPDX-License-Identifier: BSD-3-Clause
#include "progress.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace tether {

namespace {

constexpr int kWidth = 30;
constexpr std::chrono::milliseconds kRedraw(200), kLine(10000);

// Nothing is shown on a closed stream: fmt::print would throw and end the job.
void print(const std::string& text) { std::fputs(text.c_str(), stderr); }

}  // namespace

Progress::Progress(double work)
    : all_work_(work),
      terminal_(isatty(STDERR_FILENO) != 0),
      next_(Clock::now() + (terminal_ ? kRedraw : kLine)) {}

void Progress::start(const std::string& what, double duration, double work) {
  run_work_ = work;
  what_ = what;
  duration_ = duration;
  at(0.0);
}

void Progress::at(double t) {
  share_ = t / duration_;
  const Clock::time_point now = Clock::now();
  if (now >= next_) show(now);
}

void Progress::finish() {
  done_work_ += run_work_;
  run_work_ = 0.0;
  at(0.0);
}

void Progress::show(Clock::time_point now) {
  next_ = now + (terminal_ ? kRedraw : kLine);
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

void Progress::hide() {
  if (terminal_) print("\r\033[K");
}

}  // namespace tether
