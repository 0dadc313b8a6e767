// Tether: IDA's error test of algebraic variables. SPDX-License-Identifier: BSD-3-Clause
//
// The test protects runs in which F has several roots y_a: no other variable notices a jump from
// one root to another. But y_a = y_a(t, y_d) responds to a move dy by S dy, S = dy_a/dy_d. The
// polish leaves a part of that response, which differs from step to step. Where S is large this
// part exceeds the tolerance at every step size.
//
// ycor is a difference of order k + 1 of the history. Independent errors of size r contribute
// r sqrt(C(2k+2, k+1)) to it, and the test multiplies it by about 1/(k+1). The tolerance grows by a
// multiple of that contribution, and stays as it is where y_a does not respond.
//
// Variables that rows are solved for follow these, and leave nothing of that where nothing else
// moves.
//
// S dy is measured by a polish after the move. A polish before it has removed the noise of the
// corrector, which is no response. S depends on the direction of dy and is measured again and
// again.
//
// A jump of F in time, as of a switched force, makes y_a jump, too. Steps beyond it fail the test
// however short they are, and steps that end before it are accepted without end. The test is then
// left out until ten steps in a row are accepted.
#include "step/algebraic_test.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "host/rounding.hpp"

namespace tether::ida_projection {

namespace {

// Multiple of the contribution of independent errors. With a third of it some steps are rejected
// for nothing; with ten times as much errors of charged circuits pass.
constexpr double kOfNoise = 10.0;
constexpr double kRounding = 1e3 * kEpsilon;  // of y_a, by F and J
constexpr double kMemory = 0.9;               // per step: S changes slowly
constexpr int kMeasured = 10;                 // steps after which that has halved, about
constexpr double kStays = 0.5;  // of the first error; an error that h determines falls below 1/16
// Steps shorter by this factor, in which y_a still jumps, meet a jump of F. The fronts of
// titrations are far wider.
constexpr double kAtOnce = 1e-6;
// Accepted steps in a row after which the jump is passed. Before a jump at most five are accepted
// in a row, as IDA cuts a rejected step to a quarter. The history reaches back by six.
constexpr int kBeyond = 10;

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

// A response within rounding says nothing of S.
void AlgebraicTest::note_response(const Candidate& candidate, double move, const double* response) {
  measured_ = 0;
  for (Variable& v : variables_) {
    const double size = std::abs(response[v.index]), rate = size / move;
    if (size > kRounding * std::abs(candidate.base_entries[v.index]) && std::isfinite(rate))
      v.response = std::max(v.response, rate);
  }
}

double AlgebraicTest::response_length(const Candidate& candidate) const {
  if (variables_.empty()) return 0.0;
  if (last_.h == 0.0 || measured_ >= kMeasured) return std::numeric_limits<double>::infinity();
  double sum = 0.0;
  for (const Variable& v : variables_) {
    const double entry = v.response * candidate.weight_entries[v.index];
    sum += entry * entry;
  }
  return std::sqrt(sum / static_cast<double>(N_VGetLength(candidate.weights)));
}

bool AlgebraicTest::stay() const {
  return last_.h < first_.h && last_.error > kStays * first_.error;
}

void AlgebraicTest::widen(const Attempt& attempt, const Candidate& candidate, double move,
                          const double* response, const std::vector<int>& solved) {
  detect_jump(attempt);
  if (attempt.accepted) {
    ++measured_;
    for (Variable& v : variables_) {
      v.moved = kMemory * std::max(v.moved, v.response * move_);
      v.response *= kMemory;
    }
  }
  move_ = move;
  if (response != nullptr) note_response(candidate, move, response);
  for (Variable& v : variables_)
    if (std::binary_search(solved.begin(), solved.end(), v.index)) v.response = v.moved = 0.0;
  if (order_ != attempt.order) {
    order_ = attempt.order;
    noise_ = kOfNoise * noise_in_test(order_);
  }
  double* const weights = N_VGetArrayPointer(candidate.weights);
  double sum = 0.0;
  for (Variable& v : variables_) {
    double& weight = weights[v.index];
    v.weight = weight;
    // Rounding makes independent errors, too.
    const double error =
        std::max(v.moved, v.response * move) + kEpsilon * std::abs(candidate.base_entries[v.index]);
    weight /= 1.0 + weight * noise_ * error;
    const double tested = candidate.correction_entries[v.index] * weight;
    sum += tested * tested;
    if (jump_) weight = 0.0;
  }
  const bool first = last_.h == 0.0;
  last_ = {
      std::abs(attempt.h),
      std::sqrt(sum / static_cast<double>(N_VGetLength(candidate.weights))) / (attempt.order + 1)};
  if (first) first_ = last_;
}

void AlgebraicTest::restore(N_Vector weights) const {
  if (last_.h == 0.0 || variables_.empty()) return;
  double* entries = N_VGetArrayPointer(weights);
  for (const Variable& v : variables_) entries[v.index] = v.weight;
}

}  // namespace tether::ida_projection
