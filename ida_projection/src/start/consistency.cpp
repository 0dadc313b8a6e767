// Tether: consistent starts and projected output points. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "attach/impl.hpp"
#include "start/gauss_newton.hpp"
#include "start/least_squares.hpp"

namespace tether::ida_projection {

namespace {

double largest_difference(const double* a, const double* b, int n, int* where) {
  double largest = 0.0;
  for (int i = 0; i < n; ++i)
    if (std::abs(a[i] - b[i]) > largest) {
      largest = std::abs(a[i] - b[i]);
      if (where != nullptr) *where = i;
    }
  return largest;
}

constexpr const char* kResidualEnded = "F, the residual function, returned a negative flag";

// Largest |F_i|; -1 where it is not known. `flag`: F's.
double largest_residual(IDAResFn residual, void* user_data, double t, N_Vector y, N_Vector yp,
                        int* flag) {
  if (residual == nullptr) return -1.0;
  OwnedVector r(y);
  *flag = residual(t, y, yp, r, user_data);
  return *flag == 0 ? N_VMaxNorm(r) : -1.0;
}

}  // namespace

// One step of IDA that goes nowhere: the decorated solver answers "no correction" and, on the way,
// notes the error weights and which variables are algebraic. IDA must be reinitialised afterwards.
bool Projection::Impl::probe(double t0, N_Vector yy, N_Vector yp) {
  OwnedVector y(yy), ydot(yp);
  N_VScale(1.0, yy, y);
  N_VScale(1.0, yp, ydot);
  probing_ = true;
  probed_ = false;
  sunrealtype reached = t0;
  const double tiny = 1e-8 * std::max(1.0, std::abs(t0));
  IDASolve(ida_mem_, t0 + tiny, &reached, y, ydot, IDA_ONE_STEP);
  probing_ = false;
  return probed_;
}

ConsistencyReport Projection::Impl::make_consistent(double t0, N_Vector yy, N_Vector yp,
                                                    const Consistency& how) {
  ConsistencyReport report;
  const auto fail = [&](Status why, const std::string& text) {
    IDAReInit(ida_mem_, t0, yy, yp);  // as the caller had it
    report.status = status = why;
    report.message = message = text;
    return report;
  };
  if (yy == nullptr || yp == nullptr) reject("make_consistent: yy and yp must not be null");
  if (!how.hold.empty() && static_cast<int>(how.hold.size()) != size_)
    reject("make_consistent: hold has " + std::to_string(how.hold.size()) + " entries for " +
           std::to_string(size_) + " unknowns");
  if (!mover_) return report.status = status = Status::success, report;

  int flag = 0;
  stop_flag_ = 0;
  if (IDAReInit(ida_mem_, t0, yy, yp) != 0 || !probe(t0, yy, yp)) {
    if (broken_) return fail(status, std::string(message));
    return fail(Status::internal_error,
                "IDA could not be started at the given values; set tolerances and the linear "
                "solver before make_consistent, and look at IDA's own message");
  }
  if (stop_flag_ < 0) return fail(Status::callback_fatal, std::string(stop_text_));
  report.residual_before = largest_residual(how.residual, how.user_data, t0, yy, yp, &flag);
  if (flag < 0) return fail(Status::callback_fatal, kResidualEnded);

  // y onto the constraints, algebraic variables only where rows fix them.
  OwnedVector y(yy), ydot(yp);
  N_VScale(1.0, yy, y);
  N_VScale(1.0, yp, ydot);
  project_point(t0, y, how.hold, has_algebraic_ ? static_cast<N_Vector>(id_) : nullptr, report);
  if (report.status != Status::success) return fail(report.status, report.message);

  // y' (and the algebraic variables) consistent with F.
  using Derivative = Consistency::Derivative;
  bool found = how.derivative == Derivative::keep;
  if (how.derivative == Derivative::automatic || how.derivative == Derivative::calc_ic) {
    IDAReInit(ida_mem_, t0, y, ydot);
    if (id_) {
      IDASetId(ida_mem_, id_);
      const double direction =
          how.direction != 0.0 ? how.direction : t0 + 1e-3 * std::max(1.0, std::abs(t0));
      flag = IDACalcIC(ida_mem_, IDA_YA_YDP_INIT, direction);
      if (flag == IDA_RES_FAIL) return fail(Status::callback_fatal, kResidualEnded);
      found = flag == 0 && IDAGetConsistentIC(ida_mem_, y, ydot) == 0;
    }
  }
  if (!found && how.derivative != Derivative::calc_ic && how.residual != nullptr && contiguous_) {
    const Status solved = consistent_derivative(how.residual, how.user_data, t0, y, ydot, id_,
                                                weights_, how.maximum_iterations);
    if (solved == Status::callback_fatal) return fail(solved, kResidualEnded);
    found = solved == Status::success;
  }
  if (!found)
    return fail(Status::not_converged,
                "y' consistent with F was not found; give Options::id and Consistency::residual, "
                "or keep y' with Consistency::Derivative::keep");

  // Rows that contain algebraic variables may have moved a little with them.
  ConsistencyReport again;
  project_point(t0, y, how.hold, has_algebraic_ ? static_cast<N_Vector>(id_) : nullptr, again);
  if (again.status == Status::callback_fatal) return fail(again.status, again.message);
  if (again.status == Status::success) report.drift_after = again.drift_after;

  N_VLinearSum(1.0, y, -1.0, yy, delta_);
  report.move = N_VWrmsNorm(delta_, weights_);
  if (contiguous_) {
    report.largest_change = largest_difference(N_VGetArrayPointer(y), N_VGetArrayPointer(yy), size_,
                                               &report.changed_component);
    report.derivative_change =
        largest_difference(N_VGetArrayPointer(ydot), N_VGetArrayPointer(yp), size_, nullptr);
  } else if (delta_ && static_cast<N_Vector>(delta_)->ops->nvmaxnorm != nullptr) {
    report.largest_change = N_VMaxNorm(delta_);
    N_VLinearSum(1.0, ydot, -1.0, yp, delta_);
    report.derivative_change = N_VMaxNorm(delta_);
  }
  report.residual_after = largest_residual(how.residual, how.user_data, t0, y, ydot, &flag);
  if (flag < 0) return fail(Status::callback_fatal, kResidualEnded);
  N_VScale(1.0, y, yy);
  N_VScale(1.0, ydot, yp);
  IDAReInit(ida_mem_, t0, yy, yp);
  reset_statistics();
  status = report.status = Status::success;
  message = report.message;
  return report;
}

// The nearest point on the constraints in the error weights; y changes only on success.
void Projection::Impl::project_point(double t, N_Vector y, const std::vector<bool>& hold,
                                     N_Vector id, ConsistencyReport& report) {
  if (has_values(constraints)) {
    const auto n = static_cast<std::size_t>(size_);
    double* values = N_VGetArrayPointer(y);
    const double* w = N_VGetArrayPointer(weights_);
    std::vector<double> point(values, values + size_), WT(n);
    std::vector<bool> held = options_.hold;
    for (std::size_t i = 0; i < n; ++i) {
      WT[i] = w[i] > 0.0 ? 1.0 / w[i] : std::max(1.0, std::abs(point[i]));
      if (!hold.empty() && hold[i]) {
        held.resize(n, false);
        held[i] = true;
      }
    }
    if (!point_) point_ = make_gauss_newton(constraints, size_);
    point_->project(t, point, WT, held, id != nullptr ? N_VGetArrayPointer(id) : nullptr, report);
    if (point_->fatal()) {  // met on the way, perhaps at a trial point
      report.status = Status::callback_fatal;
      report.message = point_->message();
    }
    if (report.status == Status::success) std::copy(point.begin(), point.end(), values);
    return;
  }
  if (!point_mover_) {
    point_options_ = options_;
    point_options_.metric = Metric::error_weights;
    point_options_.largest_move = 1e300;
    point_options_.maximum_iterations = 50;
    point_options_.tolerance = 1e-8;
    point_mover_ = std::holds_alternative<Gradients>(constraints.jacobian)
                       ? make_gradient_mover(constraints, point_options_, point_statistics_, y)
                       : make_user_mover(constraints, point_options_, point_statistics_, y);
  }
  OwnedVector correction(y);
  N_VConst(0.0, correction);
  const Candidate candidate{t, y, correction, weights_};
  point_mover_->forget_failure();
  const Move move = point_mover_->move(candidate);
  report.status = move.status;
  report.iterations = move.moves;
  report.drift_before = move.drift_before;
  report.drift_after = move.drift_after;
  if (move.status != Status::success) {
    report.message = point_mover_->message();
    report.contradicting_rows = point_mover_->contradicting_rows();
    return;
  }
  N_VLinearSum(1.0, y, 1.0, correction, y);
}

ConsistencyReport Projection::Impl::project(double t, N_Vector yy, N_Vector yp) {
  if (yy == nullptr) reject("project: yy must not be null");
  ConsistencyReport report;
  if (!mover_) {
    report.status = status = Status::success;
    return report;
  }
  current_weights(yy);
  OwnedVector y(yy);
  N_VScale(1.0, yy, y);
  project_point(t, y, {}, has_algebraic_ ? static_cast<N_Vector>(id_) : nullptr, report);
  if (report.status == Status::success && yp != nullptr && point_) {
    OwnedVector ydot(yp);
    N_VScale(1.0, yp, ydot);
    const double* values = N_VGetArrayPointer(y);
    const bool found = point_->tangent(t, {values, values + size_}, N_VGetArrayPointer(ydot));
    if (point_->fatal()) {
      report.status = Status::callback_fatal;
      report.message = point_->message();
    } else if (found) {
      report.derivative_change =
          largest_difference(N_VGetArrayPointer(ydot), N_VGetArrayPointer(yp), size_, nullptr);
      N_VScale(1.0, ydot, yp);
    }
  }
  if (report.status == Status::success) {
    N_VLinearSum(1.0, y, -1.0, yy, delta_);
    report.move = N_VWrmsNorm(delta_, weights_);
    if (contiguous_)
      report.largest_change = largest_difference(N_VGetArrayPointer(y), N_VGetArrayPointer(yy),
                                                 size_, &report.changed_component);
    N_VScale(1.0, y, yy);
  }
  status = report.status;
  message = report.message;
  return report;
}

// IDA's present error weights once it has some; before that, weights of relative size.
void Projection::Impl::current_weights(N_Vector y) {
  if (initialized_ && IDAGetErrWeights(ida_mem_, weights_) == 0) {
    N_VScale(1.0 / weights_factor_, weights_, weights_);
    return;
  }
  N_VAbs(y, weights_);
  N_VAddConst(weights_, 1.0, weights_);
  N_VInv(weights_, weights_);
  N_VScale(1e6, weights_, weights_);
}

int Projection::Impl::solve_and_project(double tout, double* tret, N_Vector yret, N_Vector ypret,
                                        int itask) {
  const int flag = IDASolve(ida_mem_, tout, tret, yret, ypret, itask);
  if (flag < 0 || !mover_) return flag;
  look_for_bypass();
  if (steps_unseen_ > 0) return flag;
  // A step that IDA returns as it is has been projected; what it interpolates has not.
  const Status of_step = status;
  const std::string text = message;
  project(*tret, yret, ypret);
  if (status == Status::success) {
    status = of_step;
    message = text;
  }
  return flag;
}

}  // namespace tether::ida_projection
