// Tether: the iteration after the move, foretold. SPDX-License-Identifier: BSD-3-Clause
//
// IDA multiplies its linear solutions by 2 / (1 + r), r = cj / (cj of its factors), which leaves
// the part -kappa, kappa = (r - 1) / (r + 1), of a correction where F is not stiff. While the
// factors are the same, delta is next to a multiple of the correction then, and what it is beyond
// that changes slowly. Where it is next to -kappa ycor, kappa tells the multiple for another cj,
// too.
#include "step/foretold.hpp"

#include <algorithm>

namespace tether::ida_projection {

namespace {

constexpr double kUnseen = 0.003;   // tolerances: so much may delta miss
constexpr double kNotStiff = 0.03;  // the same of what is beyond -kappa ycor
constexpr int kMost = 15;           // in a row

constexpr int kWait = 30;

}  // namespace

// Of ycor in delta.
double Foretold::share_of(N_Vector weights, N_Vector ycor, N_Vector delta) {
  N_VProd(ycor, weights, work_);
  const double square = N_VDotProd(work_, work_);
  N_VProd(work_, weights, work_);
  return square > 0.0 ? N_VDotProd(work_, delta) / square : 0.0;
}

void Foretold::doubt() {
  wait_ = kWait;
  forget();
}

void Foretold::learn(N_Vector weights, N_Vector ycor, N_Vector delta, double cj) {
  if (wait_ > 0) --wait_;
  const bool followed = known(cj);
  if (followed) {
    N_VLinearSum(1.0, delta, -share_at(cj), ycor, work_);
    N_VLinearSum(1.0, work_, -1.0, beyond_, work_);
    const bool right = N_VWrmsNorm(work_, weights) <= kUnseen;
    patience_ = right ? std::min(kMost, 2 * patience_ + 1) : patience_ / 2;
  }
  share_ = share_of(weights, ycor, delta);
  N_VLinearSum(1.0, delta, -share_, ycor, beyond_);
  if (!followed) patience_ = N_VWrmsNorm(beyond_, weights) <= kUnseen ? 1 : 0;
  cj_ = cj;
  used_in_row_ = 0;
  N_VLinearSum(1.0, delta, kappa(cj), ycor, work_);
  not_stiff_ = N_VWrmsNorm(work_, weights) <= kNotStiff;
}

}  // namespace tether::ida_projection
