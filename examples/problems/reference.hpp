// Tether: reference solutions of smooth ordinary differential equations. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace tether::problems {

/// y(t_end) of y' = f(y), y(0) = y0, to the round-off of long double: Gragg's midpoint rule
/// extrapolated to order 14 (Gragg, Bulirsch, Stoer). f(y, dy) works on std::array<long double, n>.
/// Not meant for stiff equations; mildly stiff ones want `smallest_step` a few of their shortest
/// time constants.
template <std::size_t n, class F>
std::array<long double, n> reference_solution(F f, std::array<long double, n> y, long double t_end,
                                              long double smallest_step = 2e-3L) {
  using State = std::array<long double, n>;
  constexpr int kRows = 7;
  constexpr long double kTolerance = 1e-18L;
  State table[kRows], slope, before, middle, after;
  long double t = 0.0L, H = std::min(t_end, 0.1L);
  while (t < t_end) {
    H = std::min(H, t_end - t);
    f(y, slope);
    long double error = 0.0L;
    for (int k = 0; k < kRows; ++k) {
      const int substeps = 2 * (k + 1);
      const long double h = H / substeps;
      // Changes from y, not values: their round-off is smaller, and extrapolation multiplies it.
      before.fill(0.0L);
      for (std::size_t i = 0; i < n; ++i) middle[i] = h * slope[i];
      for (int step = 1; step < substeps; ++step) {
        State at, rate;
        for (std::size_t i = 0; i < n; ++i) at[i] = y[i] + middle[i];
        f(at, rate);
        for (std::size_t i = 0; i < n; ++i) after[i] = before[i] + 2.0L * h * rate[i];
        before = middle;
        middle = after;
      }
      // Aitken-Neville in h^2; table[j] holds T(k - 1, j) until it is replaced.
      State current = middle;
      error = 0.0L;
      for (int j = 0; j < k; ++j) {
        const long double ratio = static_cast<long double>(k + 1) / static_cast<long double>(k - j);
        const State old = table[j];
        table[j] = current;
        for (std::size_t i = 0; i < n; ++i) {
          const long double change = (current[i] - old[i]) / (ratio * ratio - 1.0L);
          current[i] += change;
          if (j == k - 1)
            error = std::max(error, std::abs(change) / std::max(1.0L, std::abs(y[i])));
        }
      }
      table[k] = current;
    }
    if (error > kTolerance && H > smallest_step) {  // below: round-off, not truncation
      H /= 2.0L;
      continue;
    }
    for (std::size_t i = 0; i < n; ++i) y[i] += table[kRows - 1][i];
    t += H;
    if (error < kTolerance / 20.0L) H *= 1.5L;
  }
  return y;
}

}  // namespace tether::problems
