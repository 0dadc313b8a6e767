// Tether: consistent starts and projected output points. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "attach/impl.hpp"
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

// Largest |F_i|; -1 if F cannot be evaluated. `flag` is what F returned.
double largest_residual(IDAResFn residual, void* user_data, double t, N_Vector y, N_Vector yp,
                        int* flag) {
  if (residual == nullptr) return -1.0;
  OwnedVector r(y);
  *flag = residual(t, y, yp, r, user_data);
  return *flag == 0 ? N_VMaxNorm(r) : -1.0;
}

}  // namespace

// A start at which rows contain algebraic variables that F determines.
struct Projection::Impl::JointStart {
  double t = 0.0;
  N_Vector y = nullptr;  // moved on success
  const std::vector<bool>& hold;
  ConsistencyReport report;
};

// Solves such rows together with the equations of F, while IDA's residual callback is available.
void Projection::Impl::project_jointly(const Candidate& candidate) {
  if (inquiry_.joint_start == nullptr) return;
  movers_.joined.join(candidate, ida_.step().cj);
  if (movers_.joined.mover() != nullptr) {
    PointProjection point(movers_.joined.constraints(), options_);
    point.project(inquiry_.joint_start->t, inquiry_.joint_start->y, inquiry_.joint_start->hold,
                  movers_.joined.moved_id(), unknowns_.weights, inquiry_.joint_start->report);
  }
  movers_.joined.forget();
}

// Lets IDA attempt a step in which the decorated solver returns no correction. It records the error
// weights and the algebraic variables meanwhile. IDA must be reinitialised afterwards.
bool Projection::Impl::probe(double t0, N_Vector yy, N_Vector yp) {
  OwnedVector y(yy), ydot(yp);
  N_VScale(1.0, yy, y);
  N_VScale(1.0, yp, ydot);
  const double tiny = 1e-8 * std::max(1.0, std::abs(t0));
  bool answered = false;
  const auto answers = [&](double tout) {
    sunrealtype reached = t0;
    inquiry_.probe = Probe::asked;
    const int flag = IDASolve(ida_.mem(), tout, &reached, y, ydot, IDA_ONE_STEP);
    answered = std::exchange(inquiry_.probe, Probe::none) == Probe::answered;
    return answered || flag != IDA_ILL_INPUT;
  };
  // IDA refuses a step beyond a stop time, which may lie on one side of t0 or at t0.
  if (!answers(t0 + tiny) && !answers(t0 - tiny)) {
    IDASetStopTime(ida_.mem(), t0 + 2.0 * tiny);
    answers(t0 + tiny);
    IDAReInit(ida_.mem(), t0, yy, yp);
    IDASetStopTime(ida_.mem(), t0);
  }
  return answered;
}

// Makes y' and the algebraic variables consistent with F. Returns the reason of a failure, else an
// empty text.
std::string Projection::Impl::find_derivative(double t0, N_Vector y, N_Vector ydot,
                                              const Consistency& how, Status* failure) {
  using Derivative = Consistency::Derivative;
  bool found = how.derivative == Derivative::keep;
  *failure = Status::callback_fatal;
  if (how.derivative == Derivative::automatic || how.derivative == Derivative::calc_ic) {
    IDAReInit(ida_.mem(), t0, y, ydot);
    if (variables_.known()) {
      IDASetId(ida_.mem(), variables_.vector());
      const double direction =
          how.direction != 0.0 ? how.direction : t0 + 1e-3 * std::max(1.0, std::abs(t0));
      const int flag = IDACalcIC(ida_.mem(), IDA_YA_YDP_INIT, direction);
      if (flag == IDA_RES_FAIL) return kResidualEnded;
      found = flag == 0 && IDAGetConsistentIC(ida_.mem(), y, ydot) == 0;
    }
  }
  if (!found && how.derivative != Derivative::calc_ic && how.residual != nullptr &&
      unknowns_.contiguous) {
    const Status solved =
        consistent_derivative(how.residual, how.user_data, t0, y, ydot, variables_.vector(),
                              unknowns_.weights, how.maximum_iterations);
    if (solved == Status::callback_fatal) return kResidualEnded;
    found = solved == Status::success;
  }
  if (found) return "";
  *failure = Status::not_converged;
  return "y' consistent with F was not found; give Options::id and Consistency::residual, "
         "or keep y' with Consistency::Derivative::keep";
}

// Moves y onto the constraints; algebraic variables only if rows or F determine them. Returns false
// if IDA cannot start at this point.
bool Projection::Impl::project_start(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                                     ConsistencyReport* report, bool* jointly) {
  JointStart joint{t0, y, how.hold, {}};
  inquiry_.joint_start = &joint;
  const bool answered = IDAReInit(ida_.mem(), t0, y, ydot) == 0 && probe(t0, y, ydot);
  inquiry_.joint_start = nullptr;
  if (!answered) return false;
  if (jointly != nullptr) *jointly = joint.report.status != Status::unused;
  if (joint.report.status == Status::success)
    *report = joint.report;
  else if (!corrector_.stopped())
    point_.project(t0, y, how.hold, variables_.id(), unknowns_.weights, *report);
  return true;
}

// Alternates between rows that contain algebraic variables and the equations of F, until neither
// moves the point. The report has the length of the first projection and the last drift.
bool Projection::Impl::settle_start(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                                    ConsistencyReport* report) {
  constexpr int kRounds = 8;
  constexpr double kSettled = 1e-3;  // tolerances
  OwnedVector before(y);
  const auto fail = [report](Status why, const std::string& text) {
    report->status = why;
    report->message = text;
    return false;
  };
  for (int round = 0; round < kRounds; ++round) {
    N_VScale(1.0, y, before);
    ConsistencyReport again;
    bool jointly = false;
    bool begun = project_start(t0, y, ydot, how, &again, round == 0 ? &jointly : nullptr);
    // Far from consistent algebraic variables, rows that repeat equations of F act as conditions on
    // the other variables. Algebraic variables therefore move first if that moves the others less.
    const N_Vector id = variables_.id();
    if (begun && jointly && id != nullptr && how.hold.empty() && options_.hold.empty()) {
      const auto moved = [&](N_Vector from, N_Vector to) {
        OwnedVector way(to);
        N_VLinearSum(1.0, to, -1.0, from, way);
        return N_VWrmsNormMask(way, unknowns_.weights, id);
      };
      OwnedVector near(y), slope(ydot);
      N_VScale(1.0, before, near);
      N_VScale(1.0, ydot, slope);
      Status ignored = Status::success;
      ConsistencyReport other;
      if (find_derivative(t0, near, slope, how, &ignored).empty() &&
          project_start(t0, near, slope, how, &other, nullptr) &&
          moved(before, near) < 0.5 * moved(before, y)) {
        N_VScale(1.0, near, y);
        N_VScale(1.0, slope, ydot);
        again = other;
      }
    }
    if (!begun) {
      if (run_.broken) return fail(report_.status, std::string(report_.message));
      return fail(Status::internal_error,
                  "IDA could not be started at the given values; set tolerances and the linear "
                  "solver before make_consistent, and look at IDA's own message");
    }
    if (corrector_.stopped())
      return fail(Status::callback_fatal, std::string(corrector_.stop_text()));
    if (round == 0)
      *report = again;
    else
      report->drift_after = again.drift_after;
    if (again.status != Status::success) return fail(again.status, again.message);
    N_VLinearSum(1.0, y, -1.0, before, before);
    if (round > 0 && N_VWrmsNorm(before, unknowns_.weights) <= kSettled) return true;
    Status failure = Status::success;
    const std::string reason = find_derivative(t0, y, ydot, how, &failure);
    if (!reason.empty()) return fail(failure, reason);
    if (how.derivative == Consistency::Derivative::keep) return true;
  }
  return fail(Status::not_converged,
              "the algebraic variables that F asks for move y off the constraints again and again; "
              "start closer, or give rows without algebraic variables");
}

ConsistencyReport Projection::Impl::make_consistent(double t0, N_Vector yy, N_Vector yp,
                                                    const Consistency& how) {
  ConsistencyReport report;
  const auto fail = [&](Status why, const std::string& text) {
    IDAReInit(ida_.mem(), t0, yy, yp);  // as the caller had it
    report.status = report_.status = why;
    report.message = report_.message = text;
    return report;
  };
  if (yy == nullptr || yp == nullptr) reject("make_consistent: yy and yp must not be null");
  if (!how.hold.empty() && static_cast<int>(how.hold.size()) != unknowns_.count)
    reject("make_consistent: hold has " + std::to_string(how.hold.size()) + " entries for " +
           std::to_string(unknowns_.count) + " unknowns");
  if (static_cast<int>(how.derivative) < 0 ||
      static_cast<int>(how.derivative) > static_cast<int>(Consistency::Derivative::keep))
    reject("make_consistent: derivative = " + std::to_string(static_cast<int>(how.derivative)) +
           "; it must be one of Consistency::Derivative");
  if (!movers_.used) return report.status = report_.status = Status::success, report;

  int flag = 0;
  corrector_.forget_stop();
  OwnedVector y(yy), ydot(yp);
  N_VScale(1.0, yy, y);
  N_VScale(1.0, yp, ydot);
  const double residual_before = largest_residual(how.residual, how.user_data, t0, yy, yp, &flag);
  if (flag < 0) return fail(Status::callback_fatal, kResidualEnded);
  const bool settled = settle_start(t0, y, ydot, how, &report);
  report.residual_before = residual_before;
  if (!settled) return fail(report.status, std::string(report.message));

  OwnedVector change(yy);
  N_VLinearSum(1.0, y, -1.0, yy, change);
  report.move = N_VWrmsNorm(change, unknowns_.weights);
  if (unknowns_.contiguous) {
    report.largest_change = largest_difference(N_VGetArrayPointer(y), N_VGetArrayPointer(yy),
                                               unknowns_.count, &report.changed_component);
    report.derivative_change = largest_difference(N_VGetArrayPointer(ydot), N_VGetArrayPointer(yp),
                                                  unknowns_.count, nullptr);
  } else if (static_cast<N_Vector>(change)->ops->nvmaxnorm != nullptr) {
    report.largest_change = N_VMaxNorm(change);
    N_VLinearSum(1.0, ydot, -1.0, yp, change);
    report.derivative_change = N_VMaxNorm(change);
  }
  report.residual_after = largest_residual(how.residual, how.user_data, t0, y, ydot, &flag);
  if (flag < 0) return fail(Status::callback_fatal, kResidualEnded);
  N_VScale(1.0, y, yy);
  N_VScale(1.0, ydot, yp);
  IDAReInit(ida_.mem(), t0, yy, yp);
  reset_statistics();
  report_.status = report.status = Status::success;
  report_.message = report.message;
  return report;
}

ConsistencyReport Projection::Impl::project(double t, N_Vector yy, N_Vector yp) {
  if (yy == nullptr) reject("project: yy must not be null");
  ConsistencyReport report;
  if (!movers_.used) {
    report.status = report_.status = Status::success;
    return report;
  }
  current_weights(yy);
  OwnedVector y(yy);
  N_VScale(1.0, yy, y);
  point_.project(t, y, {}, variables_.id(), unknowns_.weights, report);
  if (report.status == Status::success && yp != nullptr) {
    OwnedVector ydot(yp);
    N_VScale(1.0, yp, ydot);
    if (point_.tangent(t, y, ydot, report)) {
      report.derivative_change = largest_difference(
          N_VGetArrayPointer(ydot), N_VGetArrayPointer(yp), unknowns_.count, nullptr);
      N_VScale(1.0, ydot, yp);
    }
  }
  if (report.status == Status::success) {
    OwnedVector change(yy);
    N_VLinearSum(1.0, y, -1.0, yy, change);
    report.move = N_VWrmsNorm(change, unknowns_.weights);
    if (unknowns_.contiguous)
      report.largest_change = largest_difference(N_VGetArrayPointer(y), N_VGetArrayPointer(yy),
                                                 unknowns_.count, &report.changed_component);
    N_VScale(1.0, y, yy);
  }
  report_.status = report.status;
  report_.message = report.message;
  return report;
}

// IDA's present error weights; before its first step, weights of relative size.
void Projection::Impl::current_weights(N_Vector y) {
  if (run_.initialized && IDAGetErrWeights(ida_.mem(), unknowns_.weights) == 0) {
    N_VScale(1.0 / control_.weights_factor(), unknowns_.weights, unknowns_.weights);
    return;
  }
  N_VAbs(y, unknowns_.weights);
  N_VAddConst(unknowns_.weights, 1.0, unknowns_.weights);
  N_VInv(unknowns_.weights, unknowns_.weights);
  N_VScale(1e6, unknowns_.weights, unknowns_.weights);
}

int Projection::Impl::solve_and_project(double tout, double* tret, N_Vector yret, N_Vector ypret,
                                        int itask) {
  const std::string misused = why_misused("solve", {yret, ypret});
  if (!misused.empty()) {
    report_.status = Status::misused;
    report_.message = misused;
    return lifetime_.over() ? IDA_MEM_NULL : IDA_ILL_INPUT;
  }
  const int flag = IDASolve(ida_.mem(), tout, tret, yret, ypret, itask);
  if (flag < 0 || !movers_.used) return flag;
  check_for_bypass();
  if (watch_.bypass.steps() > 0) return flag;
  // A point at the end of a step is projected already, an interpolated one is not.
  const Status of_step = report_.status;
  const std::string text = report_.message;
  const InUse here(in_use_);
  project(*tret, yret, ypret);
  if (report_.status == Status::success) {
    report_.status = of_step;
    report_.message = text;
  }
  return flag;
}

}  // namespace tether::ida_projection
