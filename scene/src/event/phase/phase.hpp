// Tether: one smooth phase in the hands of IDA and the projection (method, eq. 3).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "motion.hpp"
#include "sundials/ida_session.hpp"

namespace tether::scene::event {

/// From (t, y) on, with the modes that `motion` has. Its clock starts at 0, so that steps far
/// shorter than the rounding of t can be taken.
class Phase : public IdaEquations {
 public:
  /// `tolerance`: rtol and atol of IDA; `longest_first`: the first step is no longer, 0: free.
  /// No step passes `length` (s, may be infinite), where forces have a kink.
  Phase(Motion& motion, double tolerance, double max_step, double t, const VectorXd& y,
        double longest_first, double length);
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

  /// One step of IDA; throws SimulationError.
  void step();
  double start() const { return start_; }       ///< s
  double step_begin() const { return begin_; }  ///< since the start, s
  double step_end() const { return end_; }
  bool is_at_end() const { return end_ >= length_; }  ///< of its length
  /// y at a time of the last step, since the start: interpolated.
  void at(double time, VectorXd& y) const { session_->at(time, y); }
  /// The same, moved onto the constraints.
  void projected_at(double time, VectorXd& y) { session_->projected_at(time, y); }
  /// Joints would be better held by other rows than those that were chosen at the start.
  bool has_weak_rows() const {
    VectorXd y;
    at(end_, y);
    return motion_.other_joint_rows_are_better(start_ + end_, y);
  }
  Counts counts() const { return session_->counts(); }  ///< of IDA

 private:
  void residual(double t, const double* y, const double* yp, double* r) override {
    motion_.rate(start_ + t, y, rate_.data());
    for (int i = 0; i < rate_.size(); ++i) r[i] = yp[i] - rate_[i];
  }
  void jacobian(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J) override;
  void project();
  bool has_turned(double t, N_Vector y);
  bool may_reuse(double t, N_Vector y);
  void differentiate(double t, const double* y);

  Motion& motion_;
  double start_, begin_ = 0, end_ = 0, length_;
  VectorXd rate_;
  QuietContext context_;
  OwnedMatrix matrix_;
  OwnedLinearSolver solver_;
  std::optional<IdaSession> session_;
  VectorXd slips_, slips_of_matrix_;
  MatrixXd slope_;  // d(y')/dy at slope_at_
  VectorXd slope_at_;
  double asked_time_ = -1;
};

/// y moved onto the constraints of the motion at t in the weights of the tolerance, as for the
/// start of a phase. False: it cannot be.
bool move_onto_constraints(Motion& motion, double tolerance, double t, VectorXd& y);

}  // namespace tether::scene::event
