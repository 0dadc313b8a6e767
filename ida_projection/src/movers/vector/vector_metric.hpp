// Tether: the metric of the move, on any N_Vector. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_nvector.h>
#include <tether/ida_projection/options.hpp>
#include <utility>

#include "host/candidate.hpp"
#include "host/owned_vector.hpp"
#include "movers/local_metric.hpp"

namespace tether::ida_projection {

/// The local metric by vector operations: s, D (method, eq. 9, 10) and WT = 1/w. `spare` is work
/// space.
class VectorMetric {
 public:
  VectorMetric(const Options& options, N_Vector like)
      : options_(options), scale_(like), trial_(like), D_(like), WT_(like), free_(like) {}

  const OwnedVector& D() const { return D_; }
  const OwnedVector& WT() const { return WT_; }
  bool local() const { return options_.advanced.metric == Metric::local_correction; }

  void free_all() {
    N_VConst(1.0, free_);
    if (options_.advanced.hold_vector != nullptr)
      N_VScale(1.0, options_.advanced.hold_vector, free_);
  }
  /// Components that are zero in `id` do not move.
  void hold_all_but(N_Vector id) { N_VProd(free_, id, free_); }
  /// s <- max(kMetricDecay s, |correction|), which accept() keeps; uses two vectors as work space.
  void update_scale(const Candidate& candidate, OwnedVector& changes, OwnedVector& spare) {
    if (!local()) return;
    N_VAbs(candidate.correction, changes);
    larger(kMetricDecay, scale_, changes, trial_, spare);
  }
  /// WT (0 where w = 0) and D.
  void set(const Candidate& candidate, OwnedVector& spare) {
    N_VConst(0.0, WT_);
    if (static_cast<N_Vector>(WT_)->ops->nvinvtest != nullptr)
      (void)N_VInvTest(candidate.weights, WT_);
    else
      N_VInv(candidate.weights, WT_);
    if (local())
      larger(kMetricFloor, WT_, trial_, D_, spare);
    else
      N_VScale(1.0, WT_, D_);
    N_VProd(D_, free_, D_);
  }
  void accept() { std::swap(scale_, trial_); }
  void reset() {
    N_VConst(0.0, scale_);
    N_VConst(0.0, trial_);
  }

 private:
  // z = max(a x, y) elementwise, for x, y >= 0: (a x + y + |a x - y|) / 2. z may be x.
  static void larger(double a, const OwnedVector& x, const OwnedVector& y, OwnedVector& z,
                     OwnedVector& spare) {
    N_VLinearSum(a, x, -1.0, y, spare);
    N_VAbs(spare, spare);
    N_VLinearSum(0.5 * a, x, 0.5, y, z);
    N_VLinearSum(1.0, z, 0.5, spare, z);
  }

  const Options& options_;
  OwnedVector scale_, trial_;  // s: committed, and with the present candidate
  OwnedVector D_, WT_, free_;  // free_: 0 where a component is held
};

}  // namespace tether::ida_projection
