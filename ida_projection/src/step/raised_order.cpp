// Tether: the order of the formula, raised by one. SPDX-License-Identifier: BSD-3-Clause
//
// IDA's y' is that of its predictor P, of degree k through k + 1 points, plus cj e, e = y - P:
// right up to a term of y^(k+1), which e itself tells. What has P and e there has
//
//     y' = P' + c e,    c = sum_{j=1}^{k+1} 1 / (t_n - t_{n-j}).
//
// For that y' F's solution is shorter by gamma e, gamma = c / cj - 1, where F is not stiff. What F
// answers to that the polish adds; without it (where the corrector made two iterations, or the
// polish is foretold) the raised formula is stable to h lambda = -0.9 at order 5, so it has to be
// known that F is not stiff. At orders 1 and 2 it amplifies undamped oscillations that BDF damps.
//
// Algebraic variables have no formula and keep what the corrector gave them. That they belong to a
// y longer by gamma e is next to nothing where nobody integrates them: the next step starts from
// its prediction of them only.
#include "step/raised_order.hpp"

#include <algorithm>
#include <cmath>

namespace tether::ida_projection {

namespace {

constexpr int kLowest = 3;                       // order
constexpr double kMost = 0.6;                    // of a correction
constexpr double kStiff = 0.3;                   // of a change, answered by F
constexpr int kHearOften = 8, kHearSeldom = 64;  // polished attempts between questions

}  // namespace

void RaisedOrder::allocate(N_Vector like, bool contiguous) {
  contiguous_ = contiguous;
  taken_ = OwnedVector(like);
  rate_ = OwnedVector(like);
}

void RaisedOrder::reset() {
  known_ = unheard_ = 0;
  interval_ = 1;
  stiff_ = true;
  raised_ = listens_ = false;
}

void RaisedOrder::accepted() {
  std::copy_backward(times_.begin(), times_.end() - 1, times_.end());
  times_[0] = t_;
  known_ = std::min(known_ + 1, kPoints);
}

void RaisedOrder::raise(const Candidate& candidate, int order, double cj, bool polished,
                        N_Vector differential) {
  raised_ = false;
  if (order < kLowest || order + 1 > known_) return;
  if (polished) ++unheard_;
  listens_ = polished && unheard_ >= interval_;
  if (stiff_ && !listens_) return;
  double rate = 0.0;
  for (int j = 0; j <= order; ++j) rate += 1.0 / (t_ - times_[static_cast<std::size_t>(j)]);
  const double gamma = rate / cj - 1.0;
  if (!(std::abs(gamma) < kMost)) return;
  raised_ = true;
  if (!contiguous_) {
    N_VScale(gamma, candidate.correction, taken_);
    if (differential != nullptr) N_VProd(differential, taken_, taken_);
    N_VLinearSum(1.0, candidate.correction, -1.0, taken_, candidate.correction);
    return;
  }
  double* __restrict taken = N_VGetArrayPointer(taken_);
  double* __restrict ycor = candidate.correction_entries;
  const double* id = differential != nullptr ? N_VGetArrayPointer(differential) : nullptr;
  for (sunindextype i = 0, n = N_VGetLength(taken_); i < n; ++i) {
    taken[i] = id == nullptr || id[i] != 0.0 ? gamma * ycor[i] : 0.0;
    ycor[i] -= taken[i];
  }
}

void RaisedOrder::shift_rate(double cj) {
  N_VScale(1.0, predicted_rate_, rate_);
  N_VLinearSum(1.0, predicted_rate_, cj, taken_, predicted_rate_);
}

void RaisedOrder::restore_rate() { N_VScale(1.0, rate_, predicted_rate_); }

double RaisedOrder::length(const Candidate& candidate) const {
  return N_VWrmsNorm(taken_, candidate.weights);
}

void RaisedOrder::heard(double answer, double length) {
  stiff_ = !(answer <= kStiff * length);
  unheard_ = 0;
  interval_ = std::clamp(2 * interval_, kHearOften, kHearSeldom);
}

}  // namespace tether::ida_projection
