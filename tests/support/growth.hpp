// Tether: how work grows with the length of an input. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <ctime>
#include <limits>

namespace tether::test {

/// Processor time of job(8 n) over that of job(n), the least of a few runs of each: about 8 where
/// work grows with the length, 64 with its square.
template <class Job>
double growth(const Job& job, int n) {
  const auto seconds = [&job](int length, int times) {
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < times; ++k) {
      const std::clock_t start = std::clock();
      job(length);
      least = std::min(least, static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    return std::max(least, 1e-6);
  };
  const double small = seconds(n, 5);
  return seconds(8 * n, 2) / small;
}

constexpr double kLinear = 24;  // below it: the length, its logarithm, and a busy machine's caches

}  // namespace tether::test
