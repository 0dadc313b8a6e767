// Tether: the metric of the move, on contiguous vectors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/options.hpp>
#include <utility>
#include <vector>

#include "movers/loaded_candidate.hpp"

namespace tether::ida_projection {

/// The local metric: s, the size of the corrector's changes, and D (method, eq. 9, 10).
class LocalMetric {
 public:
  LocalMetric(const Options& options, int size)
      : options_(options),
        scale_(static_cast<std::size_t>(size), 0.0),
        trial_scale_(scale_),
        D_(scale_) {}

  /// Updates s with the present candidate, which accept() keeps, and D of every component: from s
  /// or, by the option, WT.
  const std::vector<double>& find(const LoadedCandidate& at);
  /// D as find() left it.
  const std::vector<double>& D() const { return D_; }
  /// One scale for each of these groups, in place of Options::group.
  void use_levels(std::vector<int> levels) { levels_ = std::move(levels); }
  void forget_levels() { levels_.clear(); }
  /// Unknowns of level 1 are the rates of those of level 0: scales obey that from now on, see
  /// limit().
  void use_rates(std::vector<int> levels) { levels_of_rates_ = std::move(levels); }
  bool by_rates() const { return !levels_of_rates_.empty(); }
  void accept() { std::swap(scale_, trial_scale_); }
  void reset();

 private:
  const std::vector<int>& group() const { return levels_.empty() ? options_.group : levels_; }
  void share(const LoadedCandidate& at);
  void limit(double h);

  const Options& options_;
  std::vector<double> scale_, trial_scale_;  // s_i: committed, and with the present candidate
  std::vector<double> D_;
  std::vector<int> levels_, levels_of_rates_;
  std::vector<double> group_sum_;
  std::vector<int> group_members_;
};

}  // namespace tether::ida_projection
