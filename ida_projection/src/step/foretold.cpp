// Tether: the iteration after the move, foretold. SPDX-License-Identifier: BSD-3-Clause
//
// IDA multiplies its linear solutions by 2 / (1 + r), r = cj / (cj of its factors). Where F is not
// stiff this leaves the part -kappa, kappa = (r - 1) / (r + 1), of a correction (method, eq. 11).
// With unchanged factors delta = share ycor + rest, and the rest changes slowly. If share is near
// -kappa, it is known for other values of cj as well.
#include "step/foretold.hpp"

#include <cmath>

namespace tether::ida_projection {

namespace {

constexpr double kUnseen = 0.003;   // tolerances: allowed error of a forecast delta
constexpr double kNotStiff = 0.03;  // tolerances: |delta + kappa ycor| up to which F is not stiff

}  // namespace

// The share of ycor in delta.
double PolishForecast::share_of(N_Vector weights, N_Vector ycor, N_Vector delta) {
  N_VProd(ycor, weights, work_);
  const double square = N_VDotProd(work_, work_);
  N_VProd(work_, weights, work_);
  return square > 0.0 ? N_VDotProd(work_, delta) / square : 0.0;
}

void PolishForecast::learn(N_Vector weights, N_Vector ycor, N_Vector delta, double cj) {
  const bool learnt = known(cj);
  if (learnt) {
    N_VLinearSum(1.0, delta, -share_at(cj), ycor, work_);
    N_VLinearSum(1.0, work_, -1.0, beyond_, work_);
    followed(N_VWrmsNorm(work_, weights) <= kUnseen);
  }
  share_ = share_of(weights, ycor, delta);
  N_VLinearSum(1.0, delta, -share_, ycor, beyond_);
  if (!learnt) allowance_ = N_VWrmsNorm(beyond_, weights) <= kUnseen ? 1 : 0;
  cj_ = cj;
  used_in_row_ = 0;
  N_VLinearSum(1.0, delta, kappa(cj), ycor, work_);
  not_stiff_ = N_VWrmsNorm(work_, weights) <= kNotStiff;
}

}  // namespace tether::ida_projection
