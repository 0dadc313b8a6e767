// Tether: the metric of the move, on contiguous vectors. SPDX-License-Identifier: BSD-3-Clause
#include "movers/local_metric.hpp"

#include <algorithm>
#include <cmath>

#include "rows/split_rows.hpp"

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

// s <- max(0.8 s, |correction|)
void LocalMetric::update_scale(const LoadedCandidate& at) {
  for (std::size_t i = 0; i < scale_.size(); ++i)
    trial_scale_[i] = std::max(kMetricDecay * scale_[i], std::abs(at.ycor[i]));
}

template <class Block>
void LocalMetric::fill(LoadedCandidate& at, Block& d, Block& a) {
  const bool local = options_.advanced.metric == Metric::local_correction;
  for (Block* block : {&d, &a}) {
    if (block->rows.empty()) continue;
    double* __restrict D = block->D();
    double* __restrict trial = trial_scale_.data();
    const double* __restrict scale = scale_.data();
    const double* __restrict w = at.w;
    const double* __restrict ycor = at.ycor;
    block->for_columns([=](int k, int i) {
      const double s = std::max(kMetricDecay * scale[i], std::abs(ycor[i]));
      trial[i] = s;
      // A component without a weight (WT = 0) has the corrector's change as its scale.
      const double weighted = 1.0 / (w[i] > 0.0 ? w[i] : 1.0);
      const double weight = w[i] > 0.0 ? weighted : s;
      D[k] = local ? std::max(s, kMetricFloor * weight) : weight;
    });
  }
  if (!local) return;
  if (!group().empty()) use_groups(at, d, a);
  if (group().empty() && !levels_of_rates_.empty()) limit(at, d);
}

template <class Block>
void LocalMetric::use_groups(LoadedCandidate& at, Block& d, Block& a) {
  find_group_scales(at);
  const std::vector<double>& WT = at.WT();
  for (Block* block : {&d, &a}) {
    double* D = block->D();
    for (std::size_t c = 0; c < block->columns.size(); ++c) {
      const auto i = static_cast<std::size_t>(block->columns[c]);
      if (group()[i] < 0) continue;
      D[c] = std::max(trial_scale_[i], kMetricFloor * (WT[i] > 0.0 ? WT[i] : trial_scale_[i]));
    }
  }
}

// Errors of positions are h times those of velocities (method, section 4). Corrections do not show
// this in the short steps of a start, where those of positions are large for their errors. Errors
// of velocities would then be repaired by changes of positions, which excite stiff components, as
// beside the pin of a long chain.
template <class Block>
void LocalMetric::limit(const LoadedCandidate& at, Block& block) const {
  double* const D = block.D();
  double sum[2] = {0.0, 0.0};
  block.for_columns([&](int k, int i) {
    const int level = levels_of_rates_[static_cast<std::size_t>(i)];
    if (level == 0 || level == 1) sum[level] += D[k] * D[k];
  });
  const double longest = at.h * std::sqrt(sum[1]), length = std::sqrt(sum[0]);
  if (!(longest > 0.0) || length <= longest) return;
  const double factor = longest / length;
  block.for_columns([&](int k, int i) {
    if (levels_of_rates_[static_cast<std::size_t>(i)] == 0) D[k] *= factor;
  });
}

void LocalMetric::current(const LoadedCandidate& at, double* D) const {
  const bool local = options_.advanced.metric == Metric::local_correction;
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    const double s = trial_scale_[i], weight = at.w[i] > 0.0 ? 1.0 / at.w[i] : s;
    D[i] = local ? std::max(s, kMetricFloor * weight) : weight;
  }
}

// One scale for each group: rms of |correction| in tolerances over its members.
void LocalMetric::find_group_scales(LoadedCandidate& at) {
  const int groups = 1 + *std::max_element(group().begin(), group().end());
  std::vector<double>& sum = group_sum_;  // no allocation after the first step
  std::vector<int>& members = group_members_;
  sum.assign(static_cast<std::size_t>(groups), 0.0);
  members.assign(static_cast<std::size_t>(groups), 0);
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    if (group()[i] < 0) continue;
    const auto k = static_cast<std::size_t>(group()[i]);
    const double s = std::max(kMetricDecay * scale_[i], std::abs(at.ycor[i]));
    sum[k] += s * at.w[i] * s * at.w[i];
    ++members[k];
  }
  const std::vector<double>& WT = at.WT();
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    if (group()[i] < 0) continue;
    const auto k = static_cast<std::size_t>(group()[i]);
    trial_scale_[i] = WT[i] * std::sqrt(sum[k] / members[k]);
  }
}

template void LocalMetric::fill(LoadedCandidate&, DenseRows::Block&, DenseRows::Block&);
template void LocalMetric::fill(LoadedCandidate&, SparseRows::Block&, SparseRows::Block&);

}  // namespace tether::ida_projection
