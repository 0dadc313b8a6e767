// Tether: IDA's error test of algebraic variables. SPDX-License-Identifier: BSD-3-Clause
//
// The test protects runs in which F has several roots y_a: no other variable notices a jump from
// one root to another. But y_a = y_a(t, y_d) responds to a move dy by S dy, S = dy_a/dy_d. The
// polish leaves a part of that response, which differs from step to step. Where S is large this
// part exceeds the tolerance at every step size.
//
// Variables that rows are solved for follow these, and leave nothing of that where nothing else
// moves.
//
// ycor is a difference of order k + 1 of the history. Independent errors of size r contribute
// r sqrt(C(2k+2, k+1)) to it, and the test multiplies it by about 1/(k+1). The tolerance grows by a
// multiple of that contribution, and stays as it is where y_a does not respond.
//
// A jump of F in time, as of a switched force, makes y_a jump, too. Steps beyond it fail the test
// however short they are, and steps that end before it are accepted without end. The test is then
// left out until ten steps in a row are accepted.
#include "step/algebraic_test.hpp"

#include <algorithm>
#include <cmath>

#include "host/rounding.hpp"
#include "step/polish.hpp"

namespace tether::ida_projection {

namespace {

// Multiple of the contribution of independent errors. A value three times smaller or larger changes
// neither the steps of forms of index 1 nor the roots of titrations; from 1e4 on some titrations
// end at another root.
constexpr double kOfNoise = 1e3;
constexpr double kRounding = 1e3 * kEpsilon;  // of y_a, by F and J
constexpr double kMemory = 0.9;               // per step: S changes slowly
constexpr double kStays = 0.5;  // of the first error; an error that h determines falls below 1/16
// Steps shorter by this factor, in which y_a still jumps, meet a jump of F. The fronts of
// titrations are far wider.
constexpr double kAtOnce = 1e-6;
// Accepted steps in a row after which the jump is passed. Before a jump at most five are accepted
// in a row, as IDA cuts a rejected step to a quarter. The history reaches back by six.
constexpr int kBeyond = 10;

bool contains(const std::vector<int>& ascending, int j) {
  return std::binary_search(ascending.begin(), ascending.end(), j);
}

double noise_in_test(int order) {
  double binomial = 1.0;
  for (int i = 1; i <= order + 1; ++i) binomial *= (order + 1.0 + i) / i;
  return std::sqrt(binomial) / (order + 1);
}

}  // namespace

void AlgebraicTest::begin(const std::vector<int>& variables) {
  *this = AlgebraicTest();
  for (const int j : variables) variables_.push_back({j});
}

// For another attempt at a step whose last attempt was rejected.
void AlgebraicTest::detect_jump(const Attempt& attempt) {
  accepted_ = attempt.accepted || last_.h == 0.0 ? accepted_ + 1 : 0;
  if (accepted_ > kBeyond) {
    refused_ = {};
    jump_ = false;
  } else if (accepted_ == 0 && refused_.h == 0.0) {
    refused_ = last_;
  } else if (accepted_ == 0 && std::abs(attempt.h) < kAtOnce * refused_.h &&
             last_.error > kStays * refused_.error) {
    jump_ = true;
  }
}

// Rounding makes independent errors, too.
double AlgebraicTest::widened(const Variable& v, double y) const {
  const double error = v.response * move_ + kEpsilon * std::abs(y);
  return v.weight / (1.0 + v.weight * noise_ * error);
}

void AlgebraicTest::widen(const Attempt& attempt, const Candidate& candidate, double move,
                          const std::vector<int>& solved, Polish& polish, const Ida& ida) {
  detect_jump(attempt);
  move_ = move;
  if (order_ != attempt.order) {
    order_ = attempt.order;
    noise_ = kOfNoise * noise_in_test(order_);
    doubled_ = std::ldexp(1.0, -(order_ + 2));
  }
  double sum = 0.0;
  for (Variable& v : variables_) {
    if (attempt.accepted) v.response *= kMemory;
    if (contains(solved, v.index)) v.response = 0.0;
    v.weight = candidate.weight_entries[v.index];
    const double error =
        candidate.correction_entries[v.index] * widened(v, candidate.base_entries[v.index]);
    sum += error * error;
  }
  const double error =
      std::sqrt(sum / static_cast<double>(N_VGetLength(candidate.weights))) / (attempt.order + 1);
  const Tested now{std::abs(attempt.h), error};
  if (last_.h == 0.0) first_ = now;
  last_ = now;
  const double* const response = error > doubled_ && polish.iterations() > 0
                                     ? polish.response(candidate, ida.step().residual)
                                     : nullptr;
  double* const weights = N_VGetArrayPointer(candidate.weights);
  for (Variable& v : variables_) {
    const double y = candidate.base_entries[v.index];
    // A response within rounding says nothing of S.
    if (response != nullptr && !contains(solved, v.index) &&
        std::abs(response[v.index]) > kRounding * std::abs(y))
      v.response = std::max(v.response, std::abs(response[v.index]) / move_);
    weights[v.index] = jump_ ? 0.0 : widened(v, y);
  }
}

bool AlgebraicTest::stay() const {
  return last_.h < first_.h && last_.error > kStays * first_.error;
}

void AlgebraicTest::restore(N_Vector weights) const {
  if (last_.h == 0.0 || variables_.empty()) return;
  double* entries = N_VGetArrayPointer(weights);
  for (const Variable& v : variables_) entries[v.index] = v.weight;
}

}  // namespace tether::ida_projection
