// Tether: a candidate on contiguous vectors, as a mover changes it. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cmath>
#include <vector>

#include "host/candidate.hpp"

namespace tether::ida_projection {

/// y = base + correction of a candidate, and the size WT of a tolerance.
class LoadedCandidate {
 public:
  explicit LoadedCandidate(int size)
      : y(static_cast<std::size_t>(size), 0.0), WT_(static_cast<std::size_t>(size), 0.0) {}

  void load(const Candidate& candidate) {
    base_ = candidate.base_entries;
    ycor = candidate.correction_entries;
    w = candidate.weight_entries;
    h = candidate.h;
    cj_ = candidate.cj;
    predicted_rate_ = candidate.predicted_rate;
    WT_known_ = false;
    restart();
  }
  /// Computes y anew from the present correction.
  void restart() { add(base_, ycor, static_cast<int>(y.size()), y.data()); }
  /// 1/w; 0 for a weight of zero, which means that the error of the component does not count.
  const std::vector<double>& WT() {
    if (!WT_known_)
      for (std::size_t i = 0; i < WT_.size(); ++i) WT_[i] = w[i] > 0.0 ? 1.0 / w[i] : 0.0;
    WT_known_ = true;
    return WT_;
  }
  /// WRMS |y| in tolerances.
  double size() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) sum += (y[i] * w[i]) * (y[i] * w[i]);
    return std::sqrt(sum * (1.0 / static_cast<double>(y.size())));
  }

  bool knows_rates() const { return predicted_rate_ != nullptr; }
  /// y'_i before the move.
  double rate(std::size_t i) const { return predicted_rate_[i] + cj_ * ycor[i]; }

  double h = 0.0;  ///< the step; 0: there is none
  std::vector<double> y;
  const double *w = nullptr, *ycor = nullptr;  ///< error weights; the corrector's change

 private:
  static void add(const double* __restrict a, const double* __restrict b, int n,
                  double* __restrict sum) {
    for (int i = 0; i < n; ++i) sum[i] = a[i] + b[i];
  }

  std::vector<double> WT_;
  bool WT_known_ = false;
  double cj_ = 0.0;
  const double *base_ = nullptr, *predicted_rate_ = nullptr;
};

}  // namespace tether::ida_projection
