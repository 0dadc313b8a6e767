// Tether: IDA's error test of algebraic variables. SPDX-License-Identifier: BSD-3-Clause
//
// The test protects a run where F has several roots: no other variable sees that y_a jumps from
// one to the other. But y_a = y_a(t, y_d) answers to a move by dy with S dy, S = dy_a/dy_d. The
// polish leaves a part of that answer, which differs from step to step, and where S is large it
// exceeds the tolerance at every step size. ycor is a difference of order k + 1 of the history: of
// independent errors of size r it contains r sqrt(C(2k+2, k+1)), and the test multiplies it by
// about 1/(k+1). The tolerance grows by a multiple of that. Where y_a does not answer to the move
// it stays as it is, however far the step leads.
//
// A jump of F in time, as under a force that is switched, makes y_a jump, too. Steps that reach
// beyond it fail the test however short they are, and those before it are accepted without end. The
// test is left out then until ten steps in a row were accepted.
#include "step/algebraic_test.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::ida_projection {

namespace {

// A multiple of the contribution of independent errors. Three times less or more keeps the steps of
// forms of index 1 and the roots of titrations; from ten thousand on some of these end at another
// root.
constexpr double kOfNoise = 1e3;
constexpr double kRounding = 1e3 * std::numeric_limits<double>::epsilon();  // of y_a, by F and J
constexpr double kMemory = 0.9;  // per step: S changes slowly
constexpr double kStays = 0.5;   // of the error; a shorter step lowers it as h, to 1/16 at least
// So much shorter a step that y_a did not follow: fronts of titrations are 1e4 times wider.
constexpr double kAtOnce = 1e-6;
// Accepted steps in a row. Before a jump there are at most five, as IDA cuts a refused step to a
// quarter; those of the history that reach back before it are six.
constexpr int kBeyond = 10;

double noise_in_test(int order) {
  double binomial = 1.0;
  for (int i = 1; i <= order + 1; ++i) binomial *= (order + 1.0 + i) / i;
  return std::sqrt(binomial) / (order + 1);
}

}  // namespace

void AlgebraicTest::begin(const std::vector<int>& variables) {
  variables_.clear();
  for (const int j : variables) variables_.push_back({j, 0.0, 0.0});
  steps_ = -1;
  accepted_ = 0;
  refused_h_ = 0.0;
  jump_ = false;
}

// An attempt at the same step: the last one was refused.
void AlgebraicTest::look_for_jump(double h, long steps) {
  accepted_ = steps != steps_ ? accepted_ + 1 : 0;
  if (accepted_ > kBeyond) {
    refused_h_ = 0.0;
    jump_ = false;
  } else if (accepted_ == 0 && refused_h_ == 0.0) {
    refused_h_ = h_;
    refused_error_ = error_;
  } else if (accepted_ == 0 && h < kAtOnce * refused_h_ && error_ > kStays * refused_error_) {
    jump_ = true;
  }
}

// Rounding makes independent errors, too.
double AlgebraicTest::widened(const Variable& v, double weight, double y) const {
  const double error = v.response * move_ + std::numeric_limits<double>::epsilon() * std::abs(y);
  return weight / (1.0 + weight * noise_ * error);
}

void AlgebraicTest::begin_attempt(const Candidate& candidate, double move, int order, double h,
                                  long steps) {
  look_for_jump(h, steps);
  h_ = h;
  if (steps != steps_)
    for (Variable& v : variables_) v.response *= kMemory;
  order_ = order;
  move_ = move;
  noise_ = kOfNoise * noise_in_test(order);
  double sum = 0.0;
  for (const Variable& v : variables_) {
    const double weight =
        widened(v, candidate.weight_entries[v.index], candidate.base_entries[v.index]);
    const double error = candidate.correction_entries[v.index] * weight;
    sum += error * error;
  }
  error_ = std::sqrt(sum / static_cast<double>(N_VGetLength(candidate.weights))) / (order + 1);
  if (steps_ < 0) first_error_ = error_;
  steps_ = steps;
}

// IDA doubles h where twice the error is at most 2^-(k+1).
bool AlgebraicTest::limit_step() const { return error_ > std::ldexp(1.0, -(order_ + 2)); }

bool AlgebraicTest::stay() const { return error_ > kStays * first_error_; }

void AlgebraicTest::widen(const Candidate& candidate, const double* response) {
  double* weights = N_VGetArrayPointer(candidate.weights);
  for (Variable& v : variables_) {
    const double y = candidate.base_entries[v.index];
    // Divided by a move that is next to nothing, rounding would be taken for S.
    if (response != nullptr && std::abs(response[v.index]) > kRounding * std::abs(y))
      v.response = std::max(v.response, std::abs(response[v.index]) / move_);
    v.weight = weights[v.index];
    weights[v.index] = jump_ ? 0.0 : widened(v, v.weight, y);
  }
}

void AlgebraicTest::restore(N_Vector weights, long steps) const {
  if (steps != steps_ || variables_.empty()) return;
  double* entries = N_VGetArrayPointer(weights);
  for (const Variable& v : variables_) entries[v.index] = v.weight;
}

}  // namespace tether::ida_projection
