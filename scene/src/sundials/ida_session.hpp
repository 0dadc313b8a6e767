// Tether: a state in the hands of IDA and the projection. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nvector/nvector_serial.h>

#include <tether/ida_projection.hpp>
#include <tether/scene/engine.hpp>

#include "quiet_context.hpp"

namespace tether::scene {

/// Figures of a file are rounded, so a start may be off the joints by this much, relative to the
/// scene's size and speed (at least 1 m, 1 m/s). It is moved onto them.
constexpr double kStartTolerance = 1e-4;
/// Newton's test, of the local tolerance: IDA's 0.33 leaves noise that singular positions magnify.
constexpr double kNewton = 0.1;
/// Steps from one anchor to the next, from which a saved state is arrived at again.
constexpr long kAnchor = 5000;

template <auto release>
struct Released {
  template <class Object>
  void operator()(Object* object) const {
    release(object);
  }
};
using OwnedVector = std::unique_ptr<_generic_N_Vector, Released<N_VDestroy>>;
using OwnedMatrix = std::unique_ptr<_generic_SUNMatrix, Released<SUNMatDestroy>>;
using OwnedLinearSolver = std::unique_ptr<_generic_SUNLinearSolver, Released<SUNLinSolFree>>;

/// The equations of a session, F(t, y, y') = 0, and the errors that it allows.
class IdaEquations {
 public:
  virtual void residual(double t, const double* y, const double* yp, double* r) = 0;
  /// dF/dy + cj dF/dy' into J; not called without a matrix.
  virtual void jacobian(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J) = 0;
  /// Errors of y_i up to this times (tolerance |y_i| + absolute_i) are allowed in a step.
  virtual double widening() const { return 1; }
  double tolerance() const { return tolerance_; }
  const Eigen::VectorXd& absolute() const { return absolute_; }

 protected:
  IdaEquations(double tolerance, Eigen::VectorXd absolute)
      : tolerance_(tolerance), absolute_(std::move(absolute)) {}
  ~IdaEquations() = default;

 private:
  double tolerance_;
  Eigen::VectorXd absolute_;
};

/// One run of IDA from a point on. The solvers that it is given, the context and the equations
/// outlive it.
class IdaSession {
 public:
  struct Start {
    double t;
    const Eigen::VectorXd &y, &yp, &id;
  };
  /// Steps are counted by the caller.
  IdaSession(QuietContext& context, const Start& start, IdaEquations& equations, double max_step);
  ~IdaSession() {
    IDAFree(&ida_);  // before the projection, which it calls
  }
  IdaSession(const IdaSession&) = delete;
  IdaSession& operator=(const IdaSession&) = delete;

  /// Throws std::runtime_error with the name of the call where IDA refuses it.
  void check(int flag, const char* call) const {
    if (flag < 0)
      throw std::runtime_error(std::string(call) + ": " + name(flag) + ". " + context_.message());
  }
  void set_first_step(double h) { check(IDASetInitStep(ida_, h), "IDASetInitStep"); }
  void set_newton(double part_of_tolerance) {
    check(IDASetNonlinConvCoef(ida_, part_of_tolerance), "IDASetNonlinConvCoef");
  }
  void set_stop(double t) { check(IDASetStopTime(ida_, t), "IDASetStopTime"); }
  /// `matrix` may be null.
  void use(SUNLinearSolver solver, SUNMatrix matrix);
  /// `options` as the engine wants them; what both engines have in common is set here.
  void project(const ida_projection::Constraints& constraints, ida_projection::Options options);

  void* ida() const { return ida_; }
  N_Vector y() const { return y_.get(); }
  N_Vector yp() const { return yp_.get(); }
  /// Null before project().
  ida_projection::Projection* projection() { return projection_ ? &*projection_ : nullptr; }
  const ida_projection::Projection* projection() const {
    return projection_ ? &*projection_ : nullptr;
  }

  int solve(double to, double& reached, int task) {
    context_.message().clear();
    return IDASolve(ida_, to, &reached, y(), yp(), task);
  }
  /// y at a time of the last step: interpolated.
  void at(double time, Eigen::VectorXd& y) const;
  /// The same, moved onto the constraints; false: it could not be.
  bool projected_at(double time, Eigen::VectorXd& y);
  /// The name of a flag.
  static std::string name(int flag) {
    const std::unique_ptr<char, Released<std::free>> text(IDAGetReturnFlagName(flag));
    return text.get();
  }
  /// IDA's work so far, and the projection's.
  Counts counts() const {
    Counts c;
    IDAGetNumSteps(ida_, &c.steps);
    IDAGetNumResEvals(ida_, &c.residual_evaluations);
    IDAGetNumJacEvals(ida_, &c.jacobian_evaluations);
    IDAGetNumErrTestFails(ida_, &c.error_test_failures);
    if (projection_) c.projections = projection_->statistics().projections;
    return c;
  }

 private:
  QuietContext& context_;
  OwnedVector y_, yp_, id_;
  double max_step_;
  void* ida_;
  std::optional<ida_projection::Projection> projection_;
};

OwnedLinearSolver dense_solver(N_Vector y, SUNMatrix matrix, SUNContext context);

/// The first step of a state y with y' = yp, whose error is an eighth of what IDA allows: at order
/// 1 IDA estimates h^2 |y''| / 4. IDA's own depends on the time asked for, and at tight tolerances
/// is so short that changes of velocity / h are rounding. It is at most `longest`, s; `sizes` are
/// beside |y|, 0 where a component does not count; `rate` gives y' at a state, which it may
/// complete.
using IdaRate = std::function<void(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp)>;
double first_step(double tolerance, double longest, const Eigen::VectorXd& sizes,
                  const IdaSession::Start& start, const IdaRate& rate);

}  // namespace tether::scene
