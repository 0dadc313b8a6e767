// Tether: one Newton iteration after the move (method, eq. 13). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

#include "fast/kernels.hpp"
#include "host/candidate.hpp"
#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/rows_at.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// Forecasts the polish delta of a correction from earlier ones, in forms without algebraic
/// variables.
///
/// IDA multiplies its linear solutions by 2 / (1 + r), r = cj / (cj of its factors). Where F is not
/// stiff this leaves the part -kappa, kappa = (r - 1) / (r + 1), of a correction (method, eq. 11).
/// With unchanged factors delta = share ycor + rest, and the rest changes slowly. If share is near
/// -kappa, it is known for other values of cj as well.
class PolishForecast {
 public:
  explicit PolishForecast(N_Vector like) : beyond_(like), work_(like) { N_VConst(0.0, beyond_); }
  void quicken() const { fast::quicken({beyond_, work_}, false); }
  void forget() { cj_ = 0.0; }
  /// IDA has new factors, made for this cj.
  void renewed(double cj) {
    cj_at_setup_ = cj;
    forget();
  }
  /// Learns from a computed delta.
  void learn(N_Vector weights, N_Vector ycor, N_Vector delta, double cj) {
    const auto small = [&](N_Vector v) { return N_VWrmsNorm(v, weights) <= kUnseen; };
    const bool learnt = known(cj);
    if (learnt) {
      N_VLinearSum(1.0, delta, -share_at(cj), ycor, work_);
      N_VLinearSum(1.0, work_, -1.0, beyond_, work_);
      allowance_ = small(work_) ? std::min(2 * allowance_ + 1, kMost) : allowance_ / 2;
    }
    N_VProd(ycor, weights, work_);
    const double square = N_VDotProd(work_, work_);
    N_VProd(work_, weights, work_);
    share_ = square > 0.0 ? N_VDotProd(work_, delta) / square : 0.0;
    N_VLinearSum(1.0, delta, -share_, ycor, beyond_);
    if (!learnt) allowance_ = small(beyond_) ? 1 : 0;
    cj_ = cj;
    used_in_row_ = 0;
    N_VLinearSum(1.0, delta, kappa(cj), ycor, work_);
    not_stiff_ = small(work_);
  }
  /// Whether delta can be forecast for a correction with this cj.
  bool can_forecast(double cj) const { return used_in_row_ < allowance_ && known(cj); }
  void tell(double cj, N_Vector ycor, N_Vector delta) const {
    N_VLinearSum(share_at(cj), ycor, 1.0, beyond_, delta);
  }
  void used() { ++used_in_row_; }

 private:
  // Tolerances, a tenth of what IDA's convergence test leaves: errors that may be.
  static constexpr double kUnseen = 0.03;
  static constexpr int kMost = 15;  // in a row

  double kappa(double cj) const { return (cj - cj_at_setup_) / (cj + cj_at_setup_); }
  bool known(double cj) const { return cj_ != 0.0 && (cj == cj_ || not_stiff_); }
  double share_at(double cj) const { return share_ + kappa(cj_) - kappa(cj); }

  OwnedVector beyond_, work_;
  double cj_at_setup_ = 0.0;
  double cj_ = 0.0;         // of the last iteration; 0: there was none with these factors
  double share_ = 0.0;      // delta was share ycor + beyond
  bool not_stiff_ = false;  // and next to -kappa ycor
  int allowance_ = 0, used_in_row_ = 0;
};

/// Outcome of a polish: none was made, or F or the linear solver failed; delta was as short as
/// IDA's convergence test promised; or the test was misled.
enum class Fix { none, confirmed, misled };

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
  bool wanted(double length, bool smoothing) const {
    if (!corrector_.solves() || iterative_) return false;
    if (options_.advanced.polish == Polished::none) return false;
    // After two iterations the corrector needs no third one, unless the algebraic variables must
    // respond to the move. With smoothed step sizes the polish is always made, because the number
    // of iterations scatters from step to step. Multipliers of index 2 are an exception: they need
    // two iterations in nearly every step, and respond to shorter moves.
    if (corrector_.iterations() <= 1) return true;
    const bool high_index = variables_.any() && variables_.high_index();
    return (smoothing && !high_index) || length > longest_without_response(smoothing);
  }
  /// Longer moves need a response of the algebraic variables; infinity if there are none.
  double longest_without_response(bool smoothing) const {
    if (!variables_.any()) return std::numeric_limits<double>::infinity();
    return smoothing ? kNeedsResponseOfMultipliers : kNeedsResponse;
  }
  /// Whether response(), of contiguous vectors, can be computed.
  bool is_response_available() const { return corrector_.solves() && !iterative_; }
  /// Length in tolerances by which the multipliers respond to rounding of y', which is that of y
  /// divided by the step; 0: F or the linear solver fails.
  double response_to_rounding(const Candidate& candidate);
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
    forget_step();  // that move is not the next one
    N_VScale(1.0, corrected_, candidate.correction);
  }

  /// After add_newton_step(): the part of delta() that is the response of algebraic variables to
  /// the move, N entries. Null: F or the linear solver fails. Costs one evaluation of F.
  /// `residual`: IDA's own, from which IDAS takes differences for sensitivities; it is restored.
  const double* response(const Candidate& candidate, N_Vector residual);
  N_Vector delta() const { return delta_; }          ///< of add_newton_step()
  N_Vector corrected() const { return corrected_; }  ///< the corrector's ycor
  long iterations() const { return iterations_; }    ///< in this solve()

 private:
  static constexpr double kNeedsResponse = 0.1;  // tolerances: a shorter move needs none of y_a
  static constexpr double kNeedsResponseOfMultipliers = 0.01;  // of index 2

  enum class Known { nothing, noise, noise_and_step };

  bool know_noise();
  void forget_step() {
    if (known_ == Known::noise_and_step) known_ = Known::noise;
  }
  bool newton_step(N_Vector ycor, N_Vector delta);
  bool solve(N_Vector delta);
  bool newton_step_at_moved_point(const Candidate& candidate);
  bool forecast_polish(const Candidate& candidate, N_Vector ycor, double cj, double tolerance);
  void learn_pattern(const Candidate& candidate, N_Vector ycor, double cj);
  /// WRMS over the differential variables.
  double differential_length(const Candidate& candidate, N_Vector v) const {
    return variables_.any() ? N_VWrmsNormMask(v, candidate.weights, variables_.id())
                            : N_VWrmsNorm(v, candidate.weights);
  }
  void apply(const Candidate& candidate, double differential, double algebraic);

  const Options& options_;
  Statistics& statistics_;
  Corrector& corrector_;
  const AlgebraicVariables& variables_;
  OwnedVector delta_, corrected_, work_, noise_, residual_;
  // noise_ is -J^-1 F at corrected_, delta_ the Newton step of the present moved point.
  Known known_ = Known::nothing;
  bool iterative_ = false;  // IDA's linear solver is a Krylov method
  double cj_at_setup_ = 0.0;
  std::optional<PolishForecast> forecast_;
  long iterations_ = 0;
};

}  // namespace tether::ida_projection
