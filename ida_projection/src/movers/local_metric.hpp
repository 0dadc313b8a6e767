// Tether: the metric of the move, on contiguous vectors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/ida_projection/options.hpp>
#include <tether/linalg/vector_code.hpp>
#include <utility>
#include <vector>

#include "host/candidate.hpp"

namespace tether::ida_projection {

constexpr double kMetricFloor = 1e-3;  ///< D_i >= kMetricFloor WT_i
constexpr double kMetricDecay = 0.8;   ///< of s, for each accepted step

/// The local metric: s, the size of the corrector's changes, and D (method, eq. 9, 10).
class LocalMetric {
 public:
  LocalMetric(const Options& options, int size)
      : options_(options),
        scale_(static_cast<std::size_t>(size), 0.0),
        trial_scale_(scale_),
        D_(scale_) {}

  /// Updates s with the present candidate, which accept() keeps. True: each D_i follows from its s
  /// alone, D(s, w); else D() has them all.
  TETHER_INLINE bool find(const Candidate& at) {
    const std::size_t n = scale_.size();
    double* __restrict trial = trial_scale_.data();
    const double* __restrict scale = scale_.data();
    const double* __restrict ycor = at.correction_entries;
    for (std::size_t i = 0; i < n; ++i)
      trial[i] = std::max(kMetricDecay * scale[i], std::abs(ycor[i]));
    const std::vector<int>& groups = levels_.empty() ? options_.group : levels_;
    const bool local = options_.advanced.metric == Metric::local_correction;
    if (local && groups.empty() && !by_rates()) return true;
    find_together(at, local, groups);
    return false;
  }
  /// D of a component, from its s and weight.
  static double D(double s, double w) {
    return std::max(s, kMetricFloor * (w > 0.0 ? 1.0 / w : s));
  }
  const double* s() const { return trial_scale_.data(); }
  const double* D() const { return D_.data(); }
  /// One scale for each of these groups, in place of Options::group; empty: no longer.
  void use_levels(std::vector<int> levels) { levels_ = std::move(levels); }
  /// Unknowns of level 1 are the rates of those of level 0: scales obey that from now on, see
  /// limit().
  void use_rates(std::vector<int> levels) { levels_of_rates_ = std::move(levels); }
  bool by_rates() const { return !levels_of_rates_.empty(); }
  void accept() { std::swap(scale_, trial_scale_); }
  void reset() {
    std::fill(scale_.begin(), scale_.end(), 0.0);
    std::fill(trial_scale_.begin(), trial_scale_.end(), 0.0);
    levels_.clear();
    levels_of_rates_.clear();
  }

 private:
  // D of components that depend on each other, or of error weights. A component without a weight
  // (WT = 0) has the corrector's change as its scale.
  [[gnu::noinline]] void find_together(const Candidate& at, bool local,
                                       const std::vector<int>& groups) {
    const double* const w = at.weight_entries;
    const std::vector<double>& s = trial_scale_;
    for (std::size_t i = 0; i < s.size(); ++i)
      D_[i] = local ? D(s[i], w[i]) : w[i] > 0.0 ? 1.0 / w[i] : s[i];
    if (local && !groups.empty())
      share(w, groups);
    else if (local)
      limit(at.h);
  }
  // One scale for each group: rms of |correction| in tolerances over its members.
  void share(const double* w, const std::vector<int>& group) {
    const auto groups = static_cast<std::size_t>(1 + *std::max_element(group.begin(), group.end()));
    group_sum_.assign(groups, 0.0);  // no allocation after the first step
    group_members_.assign(groups, 0);
    for (std::size_t i = 0; i < D_.size(); ++i) {
      if (group[i] < 0) continue;
      const auto k = static_cast<std::size_t>(group[i]);
      group_sum_[k] += trial_scale_[i] * w[i] * trial_scale_[i] * w[i];
      ++group_members_[k];
    }
    for (std::size_t i = 0; i < D_.size(); ++i) {
      if (group[i] < 0) continue;
      const auto k = static_cast<std::size_t>(group[i]);
      trial_scale_[i] =
          w[i] > 0.0 ? 1.0 / w[i] * std::sqrt(group_sum_[k] / group_members_[k]) : 0.0;
      D_[i] = D(trial_scale_[i], w[i]);
    }
  }
  // Errors of positions are h times those of velocities (method, section 4). Corrections do not
  // show this in the short steps of a start, where those of positions are large for their errors.
  // Errors of velocities would then be repaired by changes of positions, which excite stiff
  // components, as beside the pin of a long chain.
  void limit(double h) {
    double sum[2] = {0.0, 0.0};
    for (std::size_t i = 0; i < D_.size(); ++i) {
      const int level = levels_of_rates_[i];
      if (level == 0 || level == 1) sum[level] += D_[i] * D_[i];
    }
    const double longest = h * std::sqrt(sum[1]), length = std::sqrt(sum[0]);
    if (!(longest > 0.0) || length <= longest) return;
    for (std::size_t i = 0; i < D_.size(); ++i)
      if (levels_of_rates_[i] == 0) D_[i] *= longest / length;
  }

  const Options& options_;
  std::vector<double> scale_, trial_scale_;  // s_i: committed, and with the present candidate
  std::vector<double> D_;
  std::vector<int> levels_, levels_of_rates_;
  std::vector<double> group_sum_;
  std::vector<int> group_members_;
};

}  // namespace tether::ida_projection
