// Tether: smooth step sizes through IDA's public settings (method, eq. 16).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <tether/ida_projection/options.hpp>

namespace tether::ida_projection {

/// A bound of IDASetEtaFixedStepBounds that no ratio of steps reaches: keep h.
constexpr double kAnyRatio = 1e30;

/// Factors of the setpoint s: at the largest order, and its least value at lower orders, see
/// StepSmoother::setpoint().
struct SetpointFactors {
  double most = 1.0, least = 1.0;
};

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
  StepSmoother(void* ida_mem, const Options& options) : ida_mem_(ida_mem), options_(options) {}

  /// Before the first step: on only if Options::step_smoothing says so.
  void reset();
  /// From here on, in the middle of a run; leaves IDASetMaxStep alone, which the host may have
  /// used. The setpoint is `factors.most` times the usual one.
  void begin(const SetpointFactors& factors) {
    on_ = true;
    settings_.reset();
    now_.factors = factors;
  }
  bool on() const { return on_; }
  /// The corrector failed at this step size.
  void refuse(double h) { now_.refused = h; }
  /// At the end of a successful solve: `steps` accepted before this attempt, `norm` = |ycor| in the
  /// norm of IDA's error test. Returns by how much IDA's error weights are to be multiplied for
  /// the rest of this attempt (1: left alone); see reduce_by_weights().
  double control(long steps, double norm);

 private:
  static constexpr int kMaximumOrder = 5;
  static constexpr double kLargest = 2.0;      // growth of h in a step, by IDA's default
  static constexpr double kNearRefused = 0.9;  // of a rejected size: as large as that size

  void note_previous(long steps, double h, int order);
  void attempt_was_accepted();
  double setpoint(int order) const;
  double error_constant(double h, int order) const;
  double test_constant(double h, int order) const;
  double filter(double log_c, int order) const;
  bool far_below(double log_c, int order) const;
  bool near_refused(double h) const {
    return now_.refused > 0.0 && h >= kNearRefused * now_.refused;
  }
  void hold();
  double request(double ratio, double h, bool grows, double norm);
  double reduce_by_weights(double ratio, double h, double norm);
  // The settings of IDA, by default its own.
  struct Settings {
    double lowest_fixed = 1.0, highest_fixed = 2.0;  // IDASetEtaFixedStepBounds
    double largest = kLargest;
    double low = 0.0;  // IDASetEtaLow and IDASetEtaMin; 0: as IDA has them
    double max_step = 0.0;
  };
  void set(const Settings& settings);

  // From a new run on.
  struct State {
    SetpointFactors factors;
    long steps = -1;  // accepted before the attempt that IDA has not yet judged; -1: there is none
    double h = 0.0, log_c = 0.0;  // of it
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
  };

  void* ida_mem_;
  std::optional<Settings> settings_;  // IDA has these
  const Options& options_;
  bool on_ = false;
  State now_;
};

}  // namespace tether::ida_projection
