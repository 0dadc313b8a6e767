// Tether: the metric of the move, on contiguous vectors. SPDX-License-Identifier: BSD-3-Clause
#include "movers/contiguous_mover.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kMetricFloor = 1e-3;  // D_i >= kMetricFloor WT_i
constexpr double kMetricDecay = 0.8;   // per accepted step

}  // namespace

// s <- max(0.8 s, |correction|), D = s or, where the error weights are asked for, WT. Factors that
// are used again keep their D.
template <class Rows>
void ContiguousMover<Rows>::set_metric(bool for_factors) {
  const bool local = options_.metric == Metric::local_correction;
  const bool grouped = local && !options_.group.empty();
  if (!for_factors) {
    for (std::size_t i = 0; i < y_.size(); ++i)
      trial_scale_[i] = std::max(kMetricDecay * scale_[i], std::abs(ycor_[i]));
    return;
  }
  for (Block* block : {&blocks_.d, &blocks_.a}) {
    if (block->rows.empty()) continue;
    double* __restrict D = block->D();
    double* __restrict trial = trial_scale_.data();
    const double* __restrict scale = scale_.data();
    const double* __restrict w = w_;
    const double* __restrict ycor = ycor_;
    block->for_columns([=](int k, int i) {
      const double s = std::max(kMetricDecay * scale[i], std::abs(ycor[i]));
      trial[i] = s;
      // WT = 0 (unweighted): such a component moves freely by what the corrector moved it.
      const double weighted = 1.0 / (w[i] > 0.0 ? w[i] : 1.0);
      const double weight = w[i] > 0.0 ? weighted : s;
      D[k] = local ? std::max(s, kMetricFloor * weight) : weight;
    });
  }
  if (grouped) set_group_metric();
}

// One scale for each group: rms of |correction| in tolerances over its members.
template <class Rows>
void ContiguousMover<Rows>::set_group_metric() {
  const int groups = 1 + *std::max_element(options_.group.begin(), options_.group.end());
  std::vector<double>& sum = group_sum_;  // no allocation after the first step
  std::vector<int>& members = group_members_;
  sum.assign(static_cast<std::size_t>(groups), 0.0);
  members.assign(static_cast<std::size_t>(groups), 0);
  for (std::size_t i = 0; i < y_.size(); ++i) {
    if (options_.group[i] < 0) continue;
    const auto k = static_cast<std::size_t>(options_.group[i]);
    const double s = std::max(kMetricDecay * scale_[i], std::abs(ycor_[i]));
    sum[k] += s * w_[i] * s * w_[i];
    ++members[k];
  }
  const std::vector<double>& WT = this->WT();
  for (std::size_t i = 0; i < y_.size(); ++i) {
    if (options_.group[i] < 0) continue;
    const auto k = static_cast<std::size_t>(options_.group[i]);
    trial_scale_[i] = WT[i] * std::sqrt(sum[k] / members[k]);
  }
  for (Block* block : {&blocks_.d, &blocks_.a}) {
    double* D = block->D();
    for (std::size_t c = 0; c < block->columns.size(); ++c) {
      const auto i = static_cast<std::size_t>(block->columns[c]);
      if (options_.group[i] < 0) continue;
      D[c] = std::max(trial_scale_[i], kMetricFloor * (WT[i] > 0.0 ? WT[i] : trial_scale_[i]));
    }
  }
}

template <class Rows>
bool ContiguousMover<Rows>::tangency(const std::vector<double>& yp, const double* id,
                                     Tangency& out) {
  if (!blocks_.structured() || !reusable_) return false;
  const auto rows = static_cast<std::size_t>(reported_);
  const std::vector<double>& WT = this->WT();
  out.rate.assign(rows, 0.0);
  out.terms.assign(rows, 0.0);
  out.tolerance.assign(rows, 0.0);
  for (std::size_t i = 0; i < rows; ++i) {
    double rate = 0.0, terms = 0.0, square = 0.0;
    bool algebraic = false;
    blocks_.visit_row(static_cast<int>(i), [&](int j, double c) {
      const auto k = static_cast<std::size_t>(j);
      algebraic = algebraic || (c != 0.0 && id != nullptr && id[j] == 0.0);
      rate += c * yp[k];
      terms += std::abs(c * yp[k]);
      square += (c * WT[k]) * (c * WT[k]);
    });
    out.rate[i] = rate;
    out.terms[i] = algebraic ? -1.0 : terms;
    out.tolerance[i] = std::sqrt(square);
  }
  return true;
}

template bool ContiguousMover<RowBlocks>::tangency(const std::vector<double>&, const double*,
                                                   Tangency&);
template bool ContiguousMover<SparseRows>::tangency(const std::vector<double>&, const double*,
                                                    Tangency&);
template void ContiguousMover<RowBlocks>::set_metric(bool);
template void ContiguousMover<SparseRows>::set_metric(bool);

}  // namespace tether::ida_projection
