// Tether: what the effects cost. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <vector>

namespace tether::scene::smooth {

/// Seconds for each of a few parts. A null pointer in its place measures nothing.
class Stopwatch {
 public:
  explicit Stopwatch(std::size_t parts) : seconds(parts, 0.0) {}
  std::vector<double> seconds;

  void start() { last_ = Clock::now(); }
  void lap(std::size_t part) {
    const Clock::time_point now = Clock::now();
    seconds[part] += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_;
};

}  // namespace tether::scene::smooth
