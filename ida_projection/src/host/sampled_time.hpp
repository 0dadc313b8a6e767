// Tether: a total of durations from a sample of them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace tether::ida_projection {

/// The mean of the sample times the number of all; but the first one, which finds out what the
/// others keep, and what was longer than eight times the median and rare (one in a hundred at most,
/// or a single one: the machine did something else) count as they are. Durations are kept by powers
/// of two.
class SampledTime {
 public:
  void add(double seconds) {
    if (!begun_) {
      begun_ = true;
      first_ = seconds;
      return;
    }
    const int exponent = seconds > 0.0 ? std::ilogb(seconds) : kLowest;
    const auto k = static_cast<std::size_t>(std::clamp(exponent - kLowest, 0, kBins - 1));
    ++count_[k];
    sum_[k] += seconds;
    ++samples_;
  }

  double total(long all) const {
    if (samples_ == 0) return first_;
    std::size_t median = 0;
    for (long below = count_[0]; 2 * below < samples_; below += count_[median]) ++median;
    const long rare = std::max(1L, samples_ / 100);
    long outliers = 0;
    double seconds_of_outliers = 0.0, seconds = 0.0;
    for (std::size_t k = kBins; k-- > 0;) {
      const bool out = k > median + 3 && outliers + count_[k] <= rare;
      if (out) outliers += count_[k];
      (out ? seconds_of_outliers : seconds) += sum_[k];
    }
    const long regular = samples_ - outliers;
    return first_ + seconds_of_outliers +
           seconds / static_cast<double>(regular) * static_cast<double>(all - 1 - outliers);
  }

 private:
  static constexpr int kLowest = -34, kBins = 44;  // 6e-11 s to 500 s

  bool begun_ = false;
  double first_ = 0.0;
  std::array<long, kBins> count_{};
  std::array<double, kBins> sum_{};
  long samples_ = 0;
};

}  // namespace tether::ida_projection
