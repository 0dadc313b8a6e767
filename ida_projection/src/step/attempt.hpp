// Tether: attempts at steps, and what became of them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "host/ida.hpp"

namespace tether::ida_projection {

/// An attempt at a step.
struct Attempt : IntegratorData {
  bool repeated = false;  ///< the corrector has found a candidate for this step before
  bool accepted = false;  ///< IDA has accepted the candidate that was handed over last
};

/// The one place that knows whether IDA accepted an attempt, which its count of steps shows at the
/// next one.
class History {
 public:
  /// A new run starts.
  void reset() { seen_ = handed_ = -1; }
  Attempt begin(const Ida& ida) const {
    Attempt attempt{ida.integrator()};
    attempt.repeated = attempt.steps == seen_;
    attempt.accepted = attempt.steps > handed_;
    return attempt;
  }
  /// The corrector has found a candidate.
  void found(const Attempt& attempt) { seen_ = attempt.steps; }
  /// This attempt succeeds: IDA judges it.
  void hand_over(const Attempt& attempt) {
    handed_ = seen_ = attempt.steps;
    reached_ = attempt.t;
  }
  /// Whether its step is the one that was handed over last, which IDA has rejected.
  bool rejected(const Attempt& attempt) const { return attempt.steps == handed_; }
  /// Accepted before the last attempt with a candidate; -1: there was none.
  long steps() const { return seen_; }

  /// Time of the last attempt that was handed over, in this run or an earlier one; minus infinity:
  /// none.
  double reached() const { return reached_; }

 private:
  long seen_ = -1, handed_ = -1;
  double reached_ = -std::numeric_limits<double>::infinity();
};

/// Norm of IDA's error test. `mask` is 1 for the variables that it sees; null: for all.
inline double error_norm(N_Vector v, N_Vector weights, N_Vector mask) {
  return mask != nullptr ? N_VWrmsNormMask(v, weights, mask) : N_VWrmsNorm(v, weights);
}

}  // namespace tether::ida_projection
