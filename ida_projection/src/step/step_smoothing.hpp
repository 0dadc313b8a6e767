// Tether: smooth step sizes through IDA's public settings (method, eq. 16).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <tether/ida_projection/options.hpp>

namespace tether::ida_projection {

/// A bound of IDASetEtaFixedStepBounds that no ratio of steps reaches: keep h.
constexpr double kAnyRatio = 1e30;

/// Factors of the setpoint s: at the largest order, and its least value at lower orders, see
/// StepSmoother::setpoint().
struct Care {
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
  StepSmoother(void* ida_mem, const Options& options);

  /// Before the first step: on only if Options::step_smoothing says so.
  void reset();
  /// From here on, in the middle of a run; leaves IDASetMaxStep alone, which the host may have
  /// used. The setpoint is `care.most` times the usual one.
  void begin(const Care& care) {
    on_ = true;
    known_to_ida_ = false;
    care_ = care;
  }
  bool on() const { return on_; }
  /// The corrector failed at this step size.
  void refuse(double h) { refused_ = h; }
  /// At the end of a successful solve: `steps` accepted before this attempt, `norm` = |ycor| in the
  /// norm of IDA's error test. Returns by how much IDA's error weights are to be multiplied for
  /// the rest of this attempt (1: left alone); see reduce_by_weights().
  double control(long steps, double norm);

 private:
  static constexpr int kMaximumOrder = 5;
  static constexpr double kNearRefused = 0.9;  // of a rejected size: as large as that size

  void attempt_was_accepted();
  double setpoint(int order) const;
  double error_constant(double h, int order) const;
  double test_constant(double h, int order) const;
  double filter(double log_c, int order) const;
  bool far_below(double log_c, int order) const;
  bool near_refused(double h) const { return refused_ > 0.0 && h >= kNearRefused * refused_; }
  void hold();
  double request(double ratio, double h, bool grows, double norm);
  double reduce_by_weights(double ratio, double h, double norm);
  void set(double lowest_fixed, double highest_fixed, double largest, double low, double max_step);

  struct Settings {
    double lowest_fixed = 0.0, highest_fixed = 0.0, largest = 0.0, low = 0.0, max_step = 0.0;
  };

  void* ida_mem_;
  Settings set_;               // IDA has these
  bool known_to_ida_ = false;  // if so
  bool wanted_, on_ = false, owns_max_step_ = false;
  double max_step_;
  Care care_;
  int max_order_;

  // the attempt that IDA has not yet judged
  bool pending_ = false;
  double h_ = 0.0, log_c_ = 0.0;
  int order_ = 0;
  // accepted steps
  long steps_ = -1;
  std::array<double, kMaximumOrder> past_{};  // sizes, the latest first
  int known_ = 0;
  double refused_ = 0.0;   // size of the last attempt that failed, until one as long is accepted
  double ratio_ = 1.0;     // of the last change of h
  double previous_ = 0.0;  // log c before the present step or block
  bool has_previous_ = false;
  double block_sum_ = 0.0;  // of log c over the steps of one size and order
  int block_ = 0;
};

}  // namespace tether::ida_projection
