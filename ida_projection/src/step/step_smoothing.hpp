// Tether: smooth step sizes through IDA's public settings (method, eq. 16).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <tether/ida_projection/options.hpp>

#include "start/algebraic.hpp"
#include "step/attempt.hpp"
#include "step/ida_settings.hpp"

namespace tether::ida_projection {

/// The factor of the setpoint s in forms of index 2, with this number of rows (method, section 7).
double stricter_in_index_2(const Candidate& candidate, const AlgebraicVariables& variables,
                           int rows);

/// Soederlind's filter H211b (ACM TOMS 29 (2003) 1-26), p = k + 1, k the order:
///
///     r_n = (c_n c_{n-1})^(1 / (b p)) rho_{n-1}^(-1/b),   c = 1 / (s err + 1e-4),
///     h_{n+1} / h_n = rho_n = 1 + atan(r_n - 1),          b = 4,
///
/// with err IDA's estimate sigma_k |ycor| and rho_{n-1} the ratio that was really used. IDA raises
/// its order only after k + 2 steps of one size, so a ratio for every step is asked for at the
/// largest order only; below it the step is held for k + 2 steps and then changed once, by the
/// geometric mean of c over them. A rejected step or a new order starts the filter anew.
///
/// If smoothing has begun by itself, after failures, h is doubled at once as long as the error
/// of the doubled step would be at most half the setpoint: k + 2 steps for each doubling would be
/// many. The filter approaches sizes that were rejected.
class StepSmoother {
 public:
  explicit StepSmoother(const Options& options) : options_(options) {}

  /// From this attempt on. `stricter`: the factor of s.
  void begin(double stricter) { now_.emplace().stricter = stricter; }
  void end() { now_.reset(); }
  bool on() const { return now_.has_value(); }
  /// The corrector failed at this step size.
  void refuse(double h) {
    if (now_) now_->refused = h;
  }
  /// At the end of a successful solve, `norm` = |ycor| in the norm of IDA's error test.
  Control control(const Attempt& attempt, double norm);

 private:
  static constexpr int kMaximumOrder = 5;      // of BDF in IDA
  static constexpr double kLargest = 2.0;      // growth of h in a step, by IDA's default
  static constexpr double kNearRefused = 0.9;  // of a rejected size: IDA's own least reduction

  // From the beginning on.
  struct State {
    double stricter = 1.0;        // factor of the setpoint
    double h = 0.0, log_c = 0.0;  // of the attempt that IDA judges; 0: there was none
    int order = 0;
    std::array<double, kMaximumOrder> past{};  // accepted sizes, the latest first
    int known = 0;                             // of these
    double refused = 0.0;            // size of the last attempt that failed, until one is accepted
    double ratio = 1.0;              // of the last change of h
    std::optional<double> previous;  // log c before the present step or block
    double block_sum = 0.0;          // of log c over the steps of one size and order
    int block = 0;

    void end_block() {
      block = 0;
      block_sum = 0.0;
    }
    double past_or(double size, int i) const {
      return i < known ? past[static_cast<std::size_t>(i)] : size;
    }
  };

  void note_previous(bool accepted, double h, int order);
  double error_constant(double h, int order) const;
  double test_constant(double h, int order) const;
  double filter(double log_c, int order) const;
  Control request(double ratio, double error, double norm) const;
  Control reduce_by_weights(double ratio, double error, double norm) const;

  const Options& options_;
  std::optional<State> now_;
};

}  // namespace tether::ida_projection
