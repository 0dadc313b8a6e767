// Tether: the metric of the move, on contiguous vectors. SPDX-License-Identifier: BSD-3-Clause
#include "movers/local_metric.hpp"

#include <algorithm>
#include <cmath>

namespace tether::ida_projection {

namespace {

constexpr double kMetricFloor = 1e-3;  // D_i >= kMetricFloor WT_i
constexpr double kMetricDecay = 0.8;   // per accepted step

}  // namespace

void LocalMetric::reset() {
  std::fill(scale_.begin(), scale_.end(), 0.0);
  std::fill(trial_scale_.begin(), trial_scale_.end(), 0.0);
  levels_.clear();
  levels_of_rates_.clear();
}

// s <- max(0.8 s, |correction|), D = max(s, 0.001 WT)
const std::vector<double>& LocalMetric::find(const LoadedCandidate& at) {
  const bool local = options_.advanced.metric == Metric::local_correction;
  const std::size_t n = scale_.size();
  double* __restrict D = D_.data();
  double* __restrict trial = trial_scale_.data();
  const double* __restrict scale = scale_.data();
  const double* __restrict w = at.w;
  const double* __restrict ycor = at.ycor;
  for (std::size_t i = 0; i < n; ++i) {
    const double s = std::max(kMetricDecay * scale[i], std::abs(ycor[i]));
    trial[i] = s;
    // A component without a weight (WT = 0) has the corrector's change as its scale.
    const double weighted = 1.0 / (w[i] > 0.0 ? w[i] : 1.0);
    const double weight = w[i] > 0.0 ? weighted : s;
    D[i] = local ? std::max(s, kMetricFloor * weight) : weight;
  }
  if (local && !group().empty())
    share(at);
  else if (local && by_rates())
    limit(at.h);
  return D_;
}

// Errors of positions are h times those of velocities (method, section 4). Corrections do not show
// this in the short steps of a start, where those of positions are large for their errors. Errors
// of velocities would then be repaired by changes of positions, which excite stiff components, as
// beside the pin of a long chain.
void LocalMetric::limit(double h) {
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

// One scale for each group: rms of |correction| in tolerances over its members.
void LocalMetric::share(const LoadedCandidate& at) {
  const auto groups =
      static_cast<std::size_t>(1 + *std::max_element(group().begin(), group().end()));
  std::vector<double>& sum = group_sum_;  // no allocation after the first step
  std::vector<int>& members = group_members_;
  sum.assign(groups, 0.0);
  members.assign(groups, 0);
  for (std::size_t i = 0; i < D_.size(); ++i) {
    if (group()[i] < 0) continue;
    const auto k = static_cast<std::size_t>(group()[i]);
    sum[k] += trial_scale_[i] * at.w[i] * trial_scale_[i] * at.w[i];
    ++members[k];
  }
  for (std::size_t i = 0; i < D_.size(); ++i) {
    if (group()[i] < 0) continue;
    const auto k = static_cast<std::size_t>(group()[i]);
    const double WT = at.w[i] > 0.0 ? 1.0 / at.w[i] : 0.0;
    trial_scale_[i] = WT * std::sqrt(sum[k] / members[k]);
    D_[i] = std::max(trial_scale_[i], kMetricFloor * (WT > 0.0 ? WT : trial_scale_[i]));
  }
}

}  // namespace tether::ida_projection
