// Tether: tells on stderr how far a long job is. SPDX-License-Identifier: BSD-3-Clause
#include "progress.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
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
    print(fmt::format("\r\033[K[{:#<{}}{:<{}}] {:3.0f} %  {}{}", "", filled, "", kWidth - filled,
                      100.0 * share, what_, time_left(now, share)));
    std::fflush(stderr);
    visible_ = true;
  } else {
    print(fmt::format("{:3.0f} %  {}{}\n", 100.0 * share, what_, time_left(now, share)));
  }
}

// Time that is left in runs of some seconds: their steps may become dearer, so that it is a guess.
std::string Progress::time_left(Clock::time_point now, double share) const {
  const double passed = std::chrono::duration<double>(now - begin_).count();
  if (passed < 3 || share < 0.01 || share >= 1) return "";
  const double left = passed * (1 - share) / share;
  if (left < 90) return fmt::format("  about {:.0f} s left", std::ceil(left));
  if (left < 5400) return fmt::format("  about {:.0f} min left", left / 60);
  return fmt::format("  about {:.1f} h left", left / 3600);
}

void Progress::hide() {
  if (visible_) print("\r\033[K");
  visible_ = false;
}

}  // namespace tether
