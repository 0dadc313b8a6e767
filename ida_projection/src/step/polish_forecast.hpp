// Tether: the iteration after the move, forecast. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "fast/kernels.hpp"
#include "host/owned_vector.hpp"

namespace tether::ida_projection {

/// Forecasts the polish delta of a correction from earlier ones, in forms without algebraic
/// variables.
///
/// IDA multiplies its linear solutions by 2 / (1 + r), r = cj / (cj of its factors). Where F is not
/// stiff this leaves the part -kappa, kappa = (r - 1) / (r + 1), of a correction (method, eq. 11).
/// With unchanged factors delta = share ycor + rest, and the rest changes slowly. If share is near
/// -kappa, it is known for other values of cj as well.
class PolishForecast {
 public:
  explicit PolishForecast(N_Vector like) : beyond_(like), work_(like) { N_VConst(0.0, beyond_); }
  void quicken() const { fast::quicken({beyond_, work_}, false); }
  void forget() { cj_ = 0.0; }
  /// IDA has new factors, made for this cj.
  void renewed(double cj) {
    cj_at_setup_ = cj;
    forget();
  }
  /// Learns from a computed delta.
  void learn(N_Vector weights, N_Vector ycor, N_Vector delta, double cj) {
    const auto small = [&](N_Vector v) { return N_VWrmsNorm(v, weights) <= kUnseen; };
    const bool learnt = known(cj);
    if (learnt) {
      N_VLinearSum(1.0, delta, -share_at(cj), ycor, work_);
      N_VLinearSum(1.0, work_, -1.0, beyond_, work_);
      allowance_ = small(work_) ? std::min(2 * allowance_ + 1, kMost) : allowance_ / 2;
    }
    N_VProd(ycor, weights, work_);
    const double square = N_VDotProd(work_, work_);
    N_VProd(work_, weights, work_);
    share_ = square > 0.0 ? N_VDotProd(work_, delta) / square : 0.0;
    N_VLinearSum(1.0, delta, -share_, ycor, beyond_);
    if (!learnt) allowance_ = small(beyond_) ? 1 : 0;
    cj_ = cj;
    used_in_row_ = 0;
    N_VLinearSum(1.0, delta, kappa(cj), ycor, work_);
    not_stiff_ = small(work_);
  }
  /// Whether delta can be forecast for a correction with this cj.
  bool can_forecast(double cj) const { return used_in_row_ < allowance_ && known(cj); }
  void tell(double cj, N_Vector ycor, N_Vector delta) const {
    N_VLinearSum(share_at(cj), ycor, 1.0, beyond_, delta);
  }
  void used() { ++used_in_row_; }

 private:
  // Tolerances, a tenth of what IDA's convergence test leaves: errors that may be.
  static constexpr double kUnseen = 0.03;
  static constexpr int kMost = 15;  // in a row

  double kappa(double cj) const { return (cj - cj_at_setup_) / (cj + cj_at_setup_); }
  bool known(double cj) const { return cj_ != 0.0 && (cj == cj_ || not_stiff_); }
  double share_at(double cj) const { return share_ + kappa(cj_) - kappa(cj); }

  OwnedVector beyond_, work_;
  double cj_at_setup_ = 0.0;
  double cj_ = 0.0;         // of the last iteration; 0: there was none with these factors
  double share_ = 0.0;      // delta was share ycor + beyond
  bool not_stiff_ = false;  // and next to -kappa ycor
  int allowance_ = 0, used_in_row_ = 0;
};

}  // namespace tether::ida_projection
