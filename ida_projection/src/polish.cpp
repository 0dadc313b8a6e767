// Tether: one Newton iteration after the move, for noise and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
//
// With y_N, y'_N from the corrector and y_N - dy on the constraints, F is linearised at
// (y_N - dy, y'_N) and solved once with the factors that IDA has:
//
//     J delta = -F(t, y_N - dy, y'_N) = -F(t, y_N, y'_N) + F_y dy.
//
// The first term is the iteration that IDA's convergence test left out; it removes the noise that
// the history would magnify (README, "Order"). The second one is the answer of the algebraic
// variables to the move, -F_a^-1 F_d dy, the step of IDACalcIC's IDA_YA_YDP_INIT. As y' stays where
// the corrector put it, the iteration does not pull the differential variables back. What of delta
// leaves the constraints is then taken back with the projection's own factors.
#include <cmath>

#include "impl.hpp"

namespace tether::ida_projection {

bool Projection::Impl::wants_polish() const {
  if (linear_solve_ == nullptr) return false;
  if (has_algebraic_ && options_.refresh_algebraic) return true;
  if (options_.extra_iterations == 0) return false;
  // After two iterations of its own the corrector leaves nothing worth another one.
  long iterations = 0;
  SUNNonlinSolGetNumIters(inner_, &iterations);
  return iterations <= 1;
}

Status Projection::Impl::polish(const Candidate& candidate, double tolerance, void* mem) {
  // F(t, (ypred - dy) + ycor_N, yppred + cj ycor_N): shift ypred by -dy, put it back bit for bit.
  N_VScale(1.0, candidate.base, saved_);
  N_VLinearSum(1.0, candidate.correction, -1.0, newton_, delta_);
  N_VLinearSum(1.0, candidate.base, 1.0, delta_, candidate.base);
  const bool evaluated = system_(newton_, delta_, mem) == 0;
  N_VScale(1.0, saved_, candidate.base);
  if (!evaluated) return Status::success;  // a refinement; the move itself stands
  N_VScale(-1.0, delta_, delta_);
  if (linear_solve_(delta_, mem) != 0) return Status::success;
  ++statistics_.residual_evaluations;
  extra_iterations_of_last_solve_ = 1;

  // IDA multiplies linear solutions by 2 / (1 + cj / cj_at_setup), which suits variables whose
  // equations contain y'; algebraic ones take the plain solution.
  const double unscale =
      cj_at_setup_ != 0.0 ? 0.5 * (1.0 + step_data().cj / cj_at_setup_) : 1.0;
  const double algebraic = options_.refresh_algebraic ? unscale : 0.0;
  double differential = options_.extra_iterations > 0 ? 1.0 : 0.0;
  if (contiguous_) {
    double* delta = N_VGetArrayPointer(delta_);
    const double* w = N_VGetArrayPointer(candidate.weights);
    for (const int j : algebraic_) delta[j] *= algebraic;
    double sum = 0.0;
    for (int j = 0; j < size_; ++j) sum += (delta[j] * w[j]) * (delta[j] * w[j]);
    for (const int j : algebraic_) sum -= (delta[j] * w[j]) * (delta[j] * w[j]);
    // A change larger than IDA's own stopping test allows is no refinement: keep what IDA had.
    if (!(sum <= 100.0 * tolerance * tolerance * size_)) differential = 0.0;
    if (differential == 0.0) {
      saved_algebraic_.clear();
      for (const int j : algebraic_) saved_algebraic_.push_back(delta[j]);
      N_VConst(0.0, delta_);
      for (std::size_t k = 0; k < algebraic_.size(); ++k)
        if (std::isfinite(saved_algebraic_[k])) delta[algebraic_[k]] = saved_algebraic_[k];
    }
  } else {
    if (has_algebraic_) {
      // delta = differential id delta + algebraic (1 - id) delta, with vector operations only.
      N_VProd(id_, delta_, newton_);
      if (!(N_VWrmsNorm(newton_, candidate.weights) <= 10.0 * tolerance)) differential = 0.0;
      N_VLinearSum(algebraic, delta_, differential - algebraic, newton_, delta_);
    } else if (!(N_VWrmsNorm(delta_, candidate.weights) <= 10.0 * tolerance)) {
      return Status::success;
    }
  }
  if (differential > 0.0) ++statistics_.extra_iterations;
  if (has_algebraic_ && algebraic > 0.0) ++statistics_.refreshes;
  N_VLinearSum(1.0, candidate.correction, 1.0, delta_, candidate.correction);
  return mover_->settle(candidate, delta_);
}

}  // namespace tether::ida_projection
