// Tether: one Newton iteration after the move. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "host/candidate.hpp"
#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// Removes the noise that IDA's convergence test leaves and lets the algebraic variables answer to
/// the move; see polish.cpp.
class Polish {
 public:
  Polish(const Options& options, Statistics& statistics, Corrector& corrector,
         const AlgebraicVariables& variables)
      : options_(options), statistics_(statistics), corrector_(corrector), variables_(variables) {}

  void allocate(N_Vector like, bool contiguous);
  /// A new solve().
  void begin() { iterations_ = 0; }
  void note_setup(double cj) { cj_at_setup_ = cj; }
  void note_linear_solver(bool iterative) { iterative_ = iterative; }
  /// For the iteration of sensitivities, which has the same linear solver.
  void follow(const Polish& other) {
    cj_at_setup_ = other.cj_at_setup_;
    iterative_ = other.iterative_;
  }

  /// Is an iteration worth its price after a move of this length? `smoothing`: steps are smoothed.
  bool wanted(double length, bool smoothing) const;
  /// Before the move: keeps the corrector's ycor.
  void keep(const Candidate& candidate);
  /// After it: ycor <- ycor + delta, as far as delta is to be trusted. False: there is none.
  bool add_newton_step(const Candidate& candidate, double cj, double tolerance);
  /// The corrector's ycor again.
  void restore(const Candidate& candidate) const {
    N_VScale(1.0, corrected_, candidate.correction);
  }

  N_Vector delta() const { return delta_; }          ///< of add_newton_step()
  N_Vector corrected() const { return corrected_; }  ///< the corrector's ycor
  /// Was the correction as small as IDA's convergence test predicted?
  bool corrector_was_right() const { return corrector_was_right_; }
  long iterations() const { return iterations_; }  ///< in this solve()

 private:
  bool newton_step_at_moved_point(const Candidate& candidate);
  double differential_length(const Candidate& candidate);
  void apply(const Candidate& candidate, double differential, double algebraic);

  const Options& options_;
  Statistics& statistics_;
  Corrector& corrector_;
  const AlgebraicVariables& variables_;
  bool contiguous_ = false;
  int size_ = 0;
  OwnedVector delta_, corrected_, work_;
  double *delta_entries_ = nullptr, *corrected_entries_ = nullptr, *work_entries_ = nullptr;
  bool iterative_ = false;  // IDA's linear solver is a Krylov method
  bool corrector_was_right_ = true;
  double cj_at_setup_ = 0.0;
  long iterations_ = 0;
};

}  // namespace tether::ida_projection
