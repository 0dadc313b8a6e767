// Tether: Newton's convergence test of multipliers. SPDX-License-Identifier: BSD-3-Clause
//
// Multipliers of index 2 are the rates of constrained variables: an error of these that is far
// below its tolerance, divided by the step, changes them by many tolerances. The first change is by
// a Jacobian of other step sizes, and the second one takes it back. IDA takes the iteration for
// divergent, although it converges, and makes a new Jacobian.
//
// Therefore multipliers have a rate of their own, which tells how much a change leaves. After a
// first change it is the last rate with this cj and these factors. A change that is as long as the
// one before has no rate: its length must do.
#include "host/multiplier_test.hpp"

#include <algorithm>
#include <cmath>
#include <sundials/sundials_nonlinearsolver.h>
#include <utility>

namespace tether::ida_projection {

namespace {

constexpr double kDiverges = 0.9;    // IDA's largest rate
constexpr double kRoundings = 10.0;  // terms of F whose rounding may add up

}  // namespace

void MultiplierTest::set(const std::vector<int>& multipliers) {
  *this = MultiplierTest();
  multipliers_ = multipliers;
  hidden_.resize(multipliers.size());
}

void MultiplierTest::hide(N_Vector weights) {
  double* const w = N_VGetArrayPointer(weights);
  for (std::size_t i = 0; i < hidden_.size(); ++i)
    hidden_[i] = std::exchange(w[multipliers_[i]], 0.0);
}

void MultiplierTest::show(N_Vector weights) const {
  double* const w = N_VGetArrayPointer(weights);
  for (std::size_t i = 0; i < hidden_.size(); ++i) w[multipliers_[i]] = hidden_[i];
}

double MultiplierTest::length(N_Vector v, N_Vector weights) const {
  const double* const entries = N_VGetArrayPointer(v);
  const double* const w = N_VGetArrayPointer(weights);
  double square = 0.0;
  for (const int j : multipliers_) square += entries[j] * w[j] * entries[j] * w[j];
  return std::sqrt(square / static_cast<double>(N_VGetLength(v)));
}

// Once the others have converged they stay so: their changes may be rounding, which has no rate.
int MultiplierTest::judged(int before, int flag, double length, double tolerance) {
  const bool converged_before = before > 0 && others_converged_;
  others_converged_ = flag == SUN_NLS_SUCCESS || (converged_before && flag == SUN_NLS_CONV_RECVR);
  double left = length;
  if (before > 0) {
    const double rate = length / last_;
    if (rate < kDiverges) left *= share_ = rate / (1.0 - rate);
  } else {
    if (firsts_++ > 0) share_ = 1.0;
    left *= std::min(share_, 1.0);
  }
  last_ = length;
  if (!others_converged_) return flag;
  const bool converged = left <= tolerance || length * h_ <= rounding_;
  return converged ? SUN_NLS_SUCCESS : SUN_NLS_CONTINUE;
}

void MultiplierTest::allow(double rounding) { rounding_ = kRoundings * rounding * h_; }

}  // namespace tether::ida_projection
