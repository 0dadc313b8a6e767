// Tether: one Newton iteration after the move, for noise and for algebraic variables.
// SPDX-License-Identifier: BSD-3-Clause
//
// The corrector gives y_N, y'_N, and y_N - dy lies on the constraints. F is linearised at
// (y_N - dy, y'_N) and solved once with IDA's current factors (method, eq. 13):
//
//     J delta = -F(t, y_N - dy, y'_N) = -F(t, y_N, y'_N) + F_y dy.
//
// The first term is the iteration that IDA's convergence test omitted; it removes the noise that
// the history would magnify (method, eq. 12). The second term is the response of the algebraic
// variables to the move, -F_a^-1 F_d dy, the step of IDACalcIC's IDA_YA_YDP_INIT. As y' stays where
// the corrector put it, the iteration does not pull the differential variables back. The part of
// delta that leaves the constraints is removed with the factors of the projection.
//
// Krylov methods solve to the tolerance of IDA's own test: delta would be as inexact as the noise
// that it should remove.
#include "step/polish.hpp"

#include <cmath>
#include <limits>

#include "host/mechanisms.hpp"
#include "host/rounding.hpp"

namespace tether::ida_projection {

namespace {

// IDA's own test promises that one more iteration changes y by at most its tolerance.
constexpr double kMisledFactor = 2.0;

}  // namespace

void Polish::allocate(N_Vector like) {
  for (OwnedVector* each : {&delta_, &corrected_, &work_, &noise_, &residual_})
    *each = OwnedVector(like);
}

void Polish::keep(const Candidate& candidate) {
  known_ = Known::nothing;
  N_VScale(1.0, candidate.correction, corrected_);
}

// delta = -J^-1 F(t, ypred + ycor_N, yppred + cj ycor_N).
bool Polish::newton_step(N_Vector ycor, N_Vector delta) {
  return corrector_.residual(ycor, delta) == 0 && solve(delta);
}

// F -> -J^-1 F
bool Polish::solve(N_Vector delta) {
  ++statistics_.residual_evaluations;
  N_VScale(-1.0, delta, delta);
  return corrector_.solve_linear(delta);
}

bool Polish::know_noise() {
  if (known_ == Known::nothing && newton_step(corrected_, noise_)) known_ = Known::noise;
  return known_ != Known::nothing;
}

// The same at ypred - dy: IDA's own callback adds ycor to IDA's ypred and yppred, so that ypred is
// shifted for the call and put back bit for bit.
bool Polish::newton_step_at_moved_point(const Candidate& candidate) {
  if (const double* const base = candidate.base_entries; base != nullptr) {
    const auto moved = [base, moved = candidate.correction_entries,
                        corrected = N_VGetArrayPointer(corrected_)](std::size_t j) {
      return base[j] + (moved[j] - corrected[j]);
    };
    return corrector_.residual_with(candidate, moved, corrected_, delta_) == 0 && solve(delta_);
  }
  N_VScale(1.0, candidate.base, work_);
  N_VLinearSum(1.0, candidate.correction, -1.0, corrected_, delta_);
  N_VLinearSum(1.0, candidate.base, 1.0, delta_, candidate.base);
  const bool found = newton_step(corrected_, delta_);
  N_VScale(1.0, work_, candidate.base);
  return found;
}

double Polish::response_length(const Candidate& candidate) {
  if (!know_noise()) return -1.0;
  forget_step();
  if (!newton_step_at_moved_point(candidate)) return -1.0;
  known_ = Known::noise_and_step;
  N_VLinearSum(1.0, delta_, -1.0, noise_, work_);
  const double length = differential_length(candidate, work_);
  return std::isfinite(length) ? length : -1.0;
}

double Polish::response_to_rounding(const Candidate& candidate) {
  if (!corrector_.solves()) return 0.0;
  const double* const y = candidate.base_entries;
  double* const rounding = N_VGetArrayPointer(work_);
  for (sunindextype j = 0; j < N_VGetLength(work_); ++j)
    rounding[j] = kEpsilon * irregular(static_cast<std::size_t>(j)) * std::abs(y[j]);
  const auto same_y = [&](std::size_t j) { return y[j] - rounding[j]; };
  statistics_.residual_evaluations += 2;
  if (corrector_.residual_with(candidate, same_y, work_, delta_) != 0) return 0.0;
  N_VConst(0.0, work_);
  if (corrector_.residual(work_, noise_) != 0) return 0.0;
  N_VLinearSum(1.0, delta_, -1.0, noise_, delta_);
  if (!corrector_.solve_linear(delta_)) return 0.0;
  const double length = corrector_.multipliers().length(delta_, candidate.weights);
  return std::isfinite(length) ? length : 0.0;
}

const double* Polish::response(const Candidate& candidate, N_Vector residual) {
  N_VScale(1.0, residual, residual_);
  const bool known = know_noise();
  N_VScale(1.0, residual_, residual);
  if (!known) return nullptr;
  N_VLinearSum(1.0, delta_, -algebraic_factor(candidate.cj), noise_, work_);
  return N_VGetArrayPointer(work_);
}

Fix Polish::add_newton_step(const Candidate& candidate, double cj, double tolerance, bool moved) {
  const N_Vector ycor = moved ? corrected_ : candidate.correction;
  const bool known = moved && known_ == Known::noise_and_step;
  if (!known && in_use(Mechanism::forecast_polish) &&
      forecast_polish(candidate, ycor, cj, tolerance))
    return Fix::confirmed;
  if (!known && !(moved ? newton_step_at_moved_point(candidate) : newton_step(ycor, delta_)))
    return Fix::none;
  forget_step();
  ++iterations_;

  const double algebraic = algebraic_factor(cj);
  // A change longer than IDA's stopping test allows is no refinement: the Jacobian is stale.
  const double length = differential_length(candidate, delta_);
  if (!std::isfinite(variables_.any() ? N_VWrmsNorm(delta_, candidate.weights) : length)) {
    N_VConst(0.0, delta_);
    return Fix::misled;
  }
  if (!known) learn_pattern(candidate, ycor, cj);
  const bool differential = length <= 10.0 * tolerance;
  apply(candidate, differential ? 1.0 : 0.0, algebraic);
  if (differential) ++statistics_.extra_iterations;
  if (variables_.any() && algebraic > 0.0) ++statistics_.refreshes;
  return length <= kMisledFactor * tolerance ? Fix::confirmed : Fix::misled;
}

void Polish::learn_pattern(const Candidate& candidate, N_Vector ycor, double cj) {
  if (!forecast_) return;
  if (variables_.any() || corrector_.iterations() != 1) return forecast_->forget();
  forecast_->learn(candidate.weights, ycor, delta_, cj);
}

// ycor <- ycor + delta, if delta can be forecast.
bool Polish::forecast_polish(const Candidate& candidate, N_Vector ycor, double cj,
                             double tolerance) {
  if (!forecast_ || corrector_.iterations() != 1 || !forecast_->can_forecast(cj)) return false;
  forecast_->tell(cj, ycor, delta_);
  if (!(N_VWrmsNorm(delta_, candidate.weights) <= kMisledFactor * tolerance)) return false;
  forecast_->used();
  N_VLinearSum(1.0, candidate.correction, 1.0, delta_, candidate.correction);
  return true;
}

// delta_d <- differential * delta_d, delta_a <- algebraic * delta_a, ycor <- ycor + delta.
void Polish::apply(const Candidate& candidate, double differential, double algebraic) {
  if (variables_.any() && candidate.correction_entries != nullptr) {
    const double* const mask = variables_.mask();
    double* const delta = N_VGetArrayPointer(delta_);
    double* const ycor = candidate.correction_entries;
    const sunindextype n = N_VGetLength(delta_);
    TETHER_ELEMENTWISE
    for (sunindextype j = 0; j < n; ++j) {
      delta[j] *= mask[j] != 0.0 ? differential : algebraic;
      ycor[j] += delta[j];
    }
    return;
  }
  if (variables_.any()) {
    N_VProd(variables_.id(), delta_, work_);
    N_VLinearSum(1.0, delta_, -1.0, work_, delta_);
    N_VLinearSum(algebraic, delta_, differential, work_, delta_);
  } else if (differential != 1.0) {
    N_VScale(differential, delta_, delta_);
  }
  N_VLinearSum(1.0, candidate.correction, 1.0, delta_, candidate.correction);
}

}  // namespace tether::ida_projection
