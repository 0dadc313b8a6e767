// Tether: how work grows with the length of an input. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <ctime>
#include <limits>

namespace tether::test {

constexpr double kLinear = 3;  // between what grows with the length, and with its square

/// Processor time of job(8 n) over that of eight job(n), the runs side by side: about 1 where work
/// grows with the length, 8 with its square. Others on the machine slow some of them: the least of
/// several looks, of no more than are needed to come below kLinear.
template <class Job>
double growth(const Job& job, int n) {
  const auto seconds = [&job](int length, int times) {
    const std::clock_t start = std::clock();
    for (int k = 0; k < times; ++k) job(length);
    return std::max(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 1e-6);
  };
  double least = std::numeric_limits<double>::infinity();
  for (int look = 0; look < 10 && !(least < kLinear); ++look)
    least = std::min(least, seconds(8 * n, 1) / seconds(n, 8));
  return least;
}

}  // namespace tether::test
