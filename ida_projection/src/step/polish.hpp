// Tether: one Newton iteration after the move (method, eq. 13). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <optional>

#include "fast/kernels.hpp"
#include "host/candidate.hpp"
#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "start/algebraic.hpp"
#include "step/polish_forecast.hpp"

namespace tether::ida_projection {

/// Outcome of a polish.
struct Fix {
  bool made = false;  ///< false: F or the linear solver fails, or there is none
  /// Whether delta was as short as IDA's convergence test promised.
  bool corrector_was_right = true;
};

/// Removes the noise that IDA's convergence test leaves, and lets the algebraic variables respond
/// to the move; see polish.cpp.
class Polish {
 public:
  Polish(const Options& options, Statistics& statistics, Corrector& corrector,
         const AlgebraicVariables& variables)
      : options_(options), statistics_(statistics), corrector_(corrector), variables_(variables) {}

  void allocate(N_Vector like);
  /// Gives its vectors the fast kernels where they are serial.
  void quicken() const {
    fast::quicken({delta_, corrected_, work_, noise_, residual_}, false);
    if (forecast_) forecast_->quicken();
  }
  /// A new attempt begins.
  void begin() { iterations_ = 0; }
  void note_setup(double cj) {
    cj_at_setup_ = cj;
    if (forecast_) forecast_->renewed(cj);
  }
  void corrector_failed() {
    if (forecast_) forecast_->forget();
  }
  /// Allows forecasts: every correction of the one vector is polished.
  void allow_forecasts() { forecast_.emplace(delta_); }
  void note_linear_solver(bool iterative) { iterative_ = iterative; }
  /// Shares the factors of another polish: sensitivities have the same linear solver.
  void follow(const Polish& other) {
    cj_at_setup_ = other.cj_at_setup_;
    iterative_ = other.iterative_;
  }

  /// Whether a polish is worth its price after a move of this length. `smoothing`: step sizes are
  /// smoothed.
  bool wanted(double length, bool smoothing) const;
  /// Longer moves need a response of the algebraic variables; infinity if there are none.
  double longest_without_response(bool smoothing) const;
  /// Whether response(), of contiguous vectors, can be computed.
  bool is_response_available() const { return corrector_.solves() && !iterative_; }
  /// After a move: length of the response -J^-1 F_y dy over the differential variables, in
  /// tolerances; -1: F or the linear solver fails.
  double response_length(const Candidate& candidate);
  /// IDA multiplies linear solutions by 2 / (1 + cj / cj_at_setup), which suits variables whose
  /// equations contain y'; algebraic ones take the plain solution.
  double algebraic_factor(double cj) const {
    const double plain = cj_at_setup_ != 0.0 ? 0.5 * (1.0 + cj / cj_at_setup_) : 1.0;
    return options_.advanced.polish == Polished::all ? plain : 0.0;
  }
  /// Before the move: keeps the corrector's ycor.
  void keep(const Candidate& candidate);
  /// ycor <- ycor + delta, as far as delta can be trusted. `moved`: after the move.
  Fix add_newton_step(const Candidate& candidate, double cj, double tolerance, bool moved);
  /// Restores the corrector's ycor.
  void restore(const Candidate& candidate) {
    step_known_ = false;  // that move is not the next one
    N_VScale(1.0, corrected_, candidate.correction);
  }

  /// After add_newton_step(): the part of delta() that is the response of algebraic variables to
  /// the move, N entries. Null: F or the linear solver fails. Costs one evaluation of F.
  const double* response(const StepData& step);
  N_Vector delta() const { return delta_; }          ///< of add_newton_step()
  N_Vector corrected() const { return corrected_; }  ///< the corrector's ycor
  long iterations() const { return iterations_; }    ///< in this solve()

 private:
  /// -J^-1 F at the corrector's point.
  bool know_noise() { return noise_known_ = noise_known_ || newton_step(noise_); }
  bool newton_step(N_Vector delta);
  bool newton_step_at_moved_point(const Candidate& candidate);
  bool forecast_polish(const Candidate& candidate, double cj, double tolerance);
  void learn_pattern(const Candidate& candidate, double cj);
  /// WRMS over the differential variables.
  double differential_length(const Candidate& candidate, N_Vector v) const;
  void apply(const Candidate& candidate, double differential, double algebraic);

  const Options& options_;
  Statistics& statistics_;
  Corrector& corrector_;
  const AlgebraicVariables& variables_;
  OwnedVector delta_, corrected_, work_, noise_, residual_;
  bool noise_known_ = false;  // -J^-1 F at corrected_
  bool step_known_ = false;   // delta_ is that of the present moved point
  bool iterative_ = false;    // IDA's linear solver is a Krylov method
  double cj_at_setup_ = 0.0;
  std::optional<PolishForecast> forecast_;
  long iterations_ = 0;
};

}  // namespace tether::ida_projection
