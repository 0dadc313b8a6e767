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
//
// Krylov methods solve to a tolerance that suits IDA's own test: delta would be noise as long as
// what it is to remove.
#include <cmath>

#include "attach/impl.hpp"

namespace tether::ida_projection {

namespace {

// IDA's own test promises that one more iteration changes y by at most its tolerance.
constexpr double kMisled = 2.0;
constexpr double kAnswered = 0.1;  // tolerances: a shorter move needs no answer of y_a

}  // namespace

bool Projection::Impl::wants_polish(double length) const {
  if (linear_solve_ == nullptr || iterative_) return false;
  if (options_.extra_iterations == 0) return has_algebraic_ && options_.refresh_algebraic;
  // After two iterations of its own the corrector leaves nothing worth another one, unless the move
  // asks for an answer of the algebraic variables. Whether it made them varies from run to run,
  // which smooth step sizes are not meant to.
  if (smoother_.on()) return true;
  long iterations = 0;
  SUNNonlinSolGetNumIters(inner_, &iterations);
  return iterations <= 1 || (has_algebraic_ && length > kAnswered);
}

// F(t, (ypred - dy) + ycor_N, yppred + cj ycor_N) through IDA's own callback, which adds ycor to
// IDA's ypred and yppred: ypred is shifted by -dy for the call and put back bit for bit.
bool Projection::Impl::newton_step_at_moved_point(const Candidate& candidate) {
  if (contiguous_) {
    double* base = candidate.base_entries;
    for (int j = 0; j < size_; ++j) {
      saved_entries_[j] = base[j];
      base[j] += candidate.correction_entries[j] - newton_entries_[j];
    }
    const bool evaluated = residual(newton_, delta_) == 0;
    for (int j = 0; j < size_; ++j) {
      base[j] = saved_entries_[j];
      delta_entries_[j] = -delta_entries_[j];
    }
    return evaluated && solve_linear(delta_);
  }
  N_VScale(1.0, candidate.base, saved_);
  N_VLinearSum(1.0, candidate.correction, -1.0, newton_, delta_);
  N_VLinearSum(1.0, candidate.base, 1.0, delta_, candidate.base);
  const bool evaluated = residual(newton_, delta_) == 0;
  N_VScale(1.0, saved_, candidate.base);
  N_VScale(-1.0, delta_, delta_);
  return evaluated && solve_linear(delta_);
}

bool Projection::Impl::solve_linear(N_Vector rhs) {
  const int flag = linear_solve_(rhs, mem_);
  if (flag < 0) stop(flag, "IDA's linear solver failed for good, flag " + std::to_string(flag));
  return flag == 0;
}

Status Projection::Impl::polish(const Candidate& candidate, double cj, double tolerance) {
  // A refinement: where F or the linear solver fails here, the move itself stands, unless the
  // failure is to end the run; then stop() has kept it.
  return add_newton_step(candidate, cj, tolerance) ? mover_->settle(candidate, delta_)
                                                   : mover_->finish(candidate);
}

// ycor <- ycor + delta, as far as delta is to be trusted. False: there is none.
bool Projection::Impl::add_newton_step(const Candidate& candidate, double cj, double tolerance) {
  if (!newton_step_at_moved_point(candidate)) return false;
  ++statistics_.residual_evaluations;
  extra_iterations_of_last_solve_ = 1;

  // IDA multiplies linear solutions by 2 / (1 + cj / cj_at_setup), which suits variables whose
  // equations contain y'; algebraic ones take the plain solution.
  const double plain = cj_at_setup_ != 0.0 ? 0.5 * (1.0 + cj / cj_at_setup_) : 1.0;
  const double algebraic = options_.refresh_algebraic ? plain : 0.0;
  // A longer change than IDA's stopping test allows is no refinement: the factors were too old.
  const double length = differential_length(candidate);
  corrector_was_right_ = length <= kMisled * tolerance;
  const bool differential = options_.extra_iterations > 0 && length <= 10.0 * tolerance;
  apply_delta(candidate, differential ? 1.0 : 0.0, algebraic);
  if (differential) ++statistics_.extra_iterations;
  if (has_algebraic_ && algebraic > 0.0) ++statistics_.refreshes;
  return true;
}

// WRMS length of delta over the differential variables.
double Projection::Impl::differential_length(const Candidate& candidate) {
  if (!contiguous_) {
    if (!has_algebraic_) return N_VWrmsNorm(delta_, candidate.weights);
    N_VProd(id_, delta_, saved_);
    return N_VWrmsNorm(saved_, candidate.weights);
  }
  const double* id = has_algebraic_ ? N_VGetArrayPointer(id_) : nullptr;
  double sum = 0.0;
  for (int j = 0; j < size_; ++j) {
    const double change = delta_entries_[j] * candidate.weight_entries[j];
    sum += id == nullptr || id[j] != 0.0 ? change * change : 0.0;
  }
  return std::sqrt(sum / size_);
}

// delta_d <- differential * delta_d, delta_a <- algebraic * delta_a, ycor <- ycor + delta; a factor
// of 0 also removes what is not finite.
void Projection::Impl::apply_delta(const Candidate& candidate, double differential,
                                   double algebraic) {
  if (contiguous_) {
    const double* id = has_algebraic_ ? N_VGetArrayPointer(id_) : nullptr;
    for (int j = 0; j < size_; ++j) {
      const double factor = id == nullptr || id[j] != 0.0 ? differential : algebraic;
      double& delta = delta_entries_[j];
      delta = factor == 0.0 || !std::isfinite(delta) ? 0.0 : factor * delta;
      candidate.correction_entries[j] += delta;
    }
    return;
  }
  if (has_algebraic_) {
    N_VProd(id_, delta_, saved_);
    N_VLinearSum(algebraic, delta_, differential - algebraic, saved_, delta_);
  } else {
    N_VScale(differential, delta_, delta_);
  }
  N_VLinearSum(1.0, candidate.correction, 1.0, delta_, candidate.correction);
}

}  // namespace tether::ida_projection
