// Tether: processor time of contact solves. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <ctime>
#include <tether/contact/solver.hpp>
#include <vector>

namespace tether::contact {

inline double cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Milliseconds of a cold solve: median of repeats that together take `seconds`. The first solve,
// which allocates, counts only where it is the only one.
inline double timed(const Options& options, const Problem& problem, Solution& solution,
                    double seconds = 0.05) {
  Solver solver(options);
  double begin = cpu_seconds();
  solver.solve(problem, solution);
  const double once = cpu_seconds() - begin;
  const int batch = once > 1e-4 ? 1 : static_cast<int>(2e-4 / (once + 1e-7));
  std::vector<double> times{once};
  for (double sum = once; times.size() < 51 && sum < seconds;) {
    begin = cpu_seconds();
    for (int k = 0; k < batch; ++k) solver.solve(problem, solution);
    times.push_back((cpu_seconds() - begin) / batch);
    sum += times.back() * batch;
  }
  if (times.size() > 1) times.erase(times.begin());
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), middle, times.end());
  return 1e3 * *middle;
}

}  // namespace tether::contact
