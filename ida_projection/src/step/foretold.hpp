// Tether: the iteration after the move, foretold. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "fast/kernels.hpp"
#include "host/owned_vector.hpp"

namespace tether::ida_projection {

/// Forecasts the polish delta of a correction from earlier ones, in forms without algebraic
/// variables; see foretold.cpp.
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
  void learn(N_Vector weights, N_Vector ycor, N_Vector delta, double cj);
  /// Whether delta can be forecast for a correction with this cj.
  bool can_forecast(double cj) const { return used_in_row_ < allowance_ && known(cj); }
  void tell(double cj, N_Vector ycor, N_Vector delta) const {
    N_VLinearSum(share_at(cj), ycor, 1.0, beyond_, delta);
  }
  void used() { ++used_in_row_; }

 private:
  double kappa(double cj) const { return (cj - cj_at_setup_) / (cj + cj_at_setup_); }
  bool known(double cj) const { return cj_ != 0.0 && (cj == cj_ || not_stiff_); }
  double share_at(double cj) const { return share_ + kappa(cj_) - kappa(cj); }
  double share_of(N_Vector weights, N_Vector ycor, N_Vector delta);
  void followed(bool right) {
    allowance_ = right ? (2 * allowance_ + 1 < kMost ? 2 * allowance_ + 1 : kMost) : allowance_ / 2;
  }
  static constexpr int kMost = 15;  // in a row

  OwnedVector beyond_, work_;
  double cj_at_setup_ = 0.0;
  double cj_ = 0.0;         // of the last iteration; 0: there was none with these factors
  double share_ = 0.0;      // delta was share ycor + beyond
  bool not_stiff_ = false;  // and next to -kappa ycor
  int allowance_ = 0, used_in_row_ = 0;
};

}  // namespace tether::ida_projection
