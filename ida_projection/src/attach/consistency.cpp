// Tether: consistent starts and projected output points. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "attach/impl.hpp"
#include "start/least_squares.hpp"

namespace tether::ida_projection {

namespace {

// Why there is no consistent start; ends make_consistent.
struct NoStart {
  Status status;
  std::string text;
};
NoStart residual_ended() {
  return {Status::callback_fatal, "F, the residual function, returned a negative flag"};
}

// Largest |F_i|; -1 if F cannot be evaluated.
double largest_residual(const Consistency& how, double t, N_Vector y, N_Vector yp) {
  if (how.residual == nullptr) return -1.0;
  OwnedVector r(y);
  const int flag = how.residual(t, y, yp, r, how.user_data);
  if (flag < 0) throw residual_ended();
  return flag == 0 ? N_VMaxNorm(r) : -1.0;
}

// Largest change of a component, and where it is in contiguous vectors of n entries (n = 0: of
// others).
double largest_change(N_Vector from, N_Vector to, int n, int* where) {
  OwnedVector change(to);
  N_VLinearSum(1.0, to, -1.0, from, change);
  const double* entries = n > 0 ? N_VGetArrayPointer(change) : nullptr;
  double largest = 0.0;
  for (int i = 0; i < n; ++i)
    if (std::abs(entries[i]) > largest) {
      largest = std::abs(entries[i]);
      if (where != nullptr) *where = i;
    }
  const bool known = n == 0 && change->ops->nvmaxnorm != nullptr;
  return known ? N_VMaxNorm(change) : largest;
}

}  // namespace

// The decorated solver is asked for this in a step of IDA that goes nowhere.
struct Projection::Impl::Inquiry {
  double t = 0.0;
  N_Vector y = nullptr;  // moved on success, where rows contain algebraic variables of F
  const std::vector<bool>& hold;
  ConsistencyReport report;  // of that move
  bool probed = false;
};

// Error weights, algebraic variables, and the move by rows that are solved together with equations
// of F, while IDA's residual callback is available.
int Projection::Impl::answer_inquiry(Candidate& candidate) {
  N_VScale(1.0, candidate.weights, unknowns_.weights);
  if (!variables_.known()) derive_id(candidate);
  candidate.t = ida_.step().t;
  movers_.joined.join(candidate, ida_.step().cj);
  if (movers_.joined.mover() != nullptr) {
    PointProjection point(movers_.joined.constraints(), options_);
    point.project(inquiry_->t, inquiry_->y, inquiry_->hold, movers_.joined.moved_id(),
                  unknowns_.weights, inquiry_->report);
  }
  movers_.joined.forget();
  inquiry_->probed = true;
  return 0;
}

// Lets IDA attempt a step in which the decorated solver starts the inquiry and returns no
// correction. IDA must be reinitialised afterwards.
void Projection::Impl::probe(double t0, N_Vector yy, N_Vector yp, Inquiry& inquiry) {
  const OwnedVector y = copy_of(yy), ydot = copy_of(yp);
  const double tiny = 1e-8 * std::max(1.0, std::abs(t0));
  const auto starts = [&](double tout) {
    sunrealtype reached = t0;
    const int flag = IDASolve(ida_.mem(), tout, &reached, y, ydot, IDA_ONE_STEP);
    return inquiry.probed || flag != IDA_ILL_INPUT;
  };
  inquiry_ = &inquiry;
  // IDA refuses a step beyond a stop time, which may lie on one side of t0 or at t0.
  if (!starts(t0 + tiny) && !starts(t0 - tiny)) {
    IDASetStopTime(ida_.mem(), t0 + 2.0 * tiny);
    starts(t0 + tiny);
    IDAReInit(ida_.mem(), t0, yy, yp);
    IDASetStopTime(ida_.mem(), t0);
  }
  inquiry_ = nullptr;
}

// Makes y' and the algebraic variables consistent with F.
void Projection::Impl::find_derivative(double t0, N_Vector y, N_Vector ydot,
                                       const Consistency& how) {
  using Derivative = Consistency::Derivative;
  if (how.derivative == Derivative::keep) return;
  if (how.derivative != Derivative::least_squares) {
    IDAReInit(ida_.mem(), t0, y, ydot);
    if (variables_.known()) {
      IDASetId(ida_.mem(), variables_.vector());
      const double direction =
          how.direction != 0.0 ? how.direction : t0 + 1e-3 * std::max(1.0, std::abs(t0));
      const int flag = IDACalcIC(ida_.mem(), IDA_YA_YDP_INIT, direction);
      if (flag == IDA_RES_FAIL) throw residual_ended();
      if (flag == 0 && IDAGetConsistentIC(ida_.mem(), y, ydot) == 0) return;
    }
  }
  if (how.derivative != Derivative::calc_ic && how.residual != nullptr && unknowns_.contiguous) {
    const Status solved =
        consistent_derivative(how.residual, how.user_data, t0, y, ydot, variables_.vector(),
                              unknowns_.weights, how.maximum_iterations);
    if (solved == Status::callback_fatal) throw residual_ended();
    if (solved == Status::success) return;
  }
  throw NoStart{Status::not_converged,
                "y' consistent with F was not found; give Options::id and Consistency::residual, "
                "or keep y' with Consistency::Derivative::keep"};
}

// Moves y onto the constraints; algebraic variables only if rows or F determine them. `jointly`: by
// rows that were solved together with equations of F.
ConsistencyReport Projection::Impl::project_start(double t0, N_Vector y, N_Vector ydot,
                                                  const Consistency& how, bool* jointly) {
  Inquiry joint{t0, y, how.hold, {}, false};
  if (IDAReInit(ida_.mem(), t0, y, ydot) == 0) probe(t0, y, ydot, joint);
  const bool probed = joint.probed && !run_.broken;
  if (!probed && run_.broken) throw NoStart{report_.status, report_.message};
  if (!probed)
    throw NoStart{Status::internal_error,
                  "IDA could not be started at the given values; set tolerances and the linear "
                  "solver before make_consistent, and read IDA's own message"};
  if (corrector_.stopped()) throw NoStart{Status::callback_fatal, corrector_.stop_text()};
  *jointly = joint.report.status != Status::unused;
  if (joint.report.status != Status::success)
    point_.project(t0, y, how.hold, variables_.id(), unknowns_.weights, joint.report);
  return joint.report;
}

// Far from consistent algebraic variables, rows that repeat equations of F act as conditions on the
// other variables. Algebraic variables therefore move first if that moves the others less. Returns
// the report of that way, if it was taken.
std::optional<ConsistencyReport> Projection::Impl::move_algebraic_first(double t0, N_Vector start,
                                                                        N_Vector y, N_Vector ydot,
                                                                        const Consistency& how) {
  const N_Vector id = variables_.id();
  if (id == nullptr || !how.hold.empty() || !options_.hold.empty()) return {};
  const auto moved = [&](N_Vector to) {
    OwnedVector way(to);
    N_VLinearSum(1.0, to, -1.0, start, way);
    return N_VWrmsNormMask(way, unknowns_.weights, id);
  };
  const OwnedVector near = copy_of(start), slope = copy_of(ydot);
  bool jointly = false;
  try {
    find_derivative(t0, near, slope, how);
    const ConsistencyReport other = project_start(t0, near, slope, how, &jointly);
    if (!(moved(near) < 0.5 * moved(y))) return {};
    N_VScale(1.0, near, y);
    N_VScale(1.0, slope, ydot);
    return other;
  } catch (const NoStart&) {
    return {};
  }
}

// Alternates between rows that contain algebraic variables and the equations of F, until neither
// moves the point. The report has the length of the first projection and the last drift.
void Projection::Impl::settle_start(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                                    ConsistencyReport& report) {
  constexpr int kRounds = 8;
  constexpr double kSettled = 1e-3;  // tolerances
  const double residual_before = report.residual_before;
  for (int round = 0; round < kRounds; ++round) {
    const OwnedVector before = copy_of(y);
    bool jointly = false;
    ConsistencyReport again = project_start(t0, y, ydot, how, &jointly);
    if (round == 0) {
      report = jointly ? move_algebraic_first(t0, before, y, ydot, how).value_or(again) : again;
      report.residual_before = residual_before;
    } else {
      report.drift_after = again.drift_after;
    }
    if (round == 0) again = report;
    if (corrector_.stopped()) throw NoStart{Status::callback_fatal, corrector_.stop_text()};
    if (again.status != Status::success) throw NoStart{again.status, again.message};
    N_VLinearSum(1.0, y, -1.0, before, before);
    if (round > 0 && N_VWrmsNorm(before, unknowns_.weights) <= kSettled) return;
    find_derivative(t0, y, ydot, how);
    if (how.derivative == Consistency::Derivative::keep) return;
  }
  throw NoStart{Status::not_converged,
                "the algebraic variables that F asks for move y off the constraints again and "
                "again; start closer, or give rows without algebraic variables"};
}

ConsistencyReport Projection::Impl::make_consistent(double t0, N_Vector yy, N_Vector yp,
                                                    const Consistency& how) {
  if (yy == nullptr || yp == nullptr) reject("make_consistent: yy and yp must not be null");
  if (!how.hold.empty() && static_cast<int>(how.hold.size()) != unknowns_.count)
    reject("make_consistent: hold has " + std::to_string(how.hold.size()) + " entries for " +
           std::to_string(unknowns_.count) + " unknowns");
  if (static_cast<int>(how.derivative) < 0 || how.derivative > Consistency::Derivative::keep)
    reject("make_consistent: derivative = " + std::to_string(static_cast<int>(how.derivative)) +
           "; it must be one of Consistency::Derivative");
  ConsistencyReport report;
  report.status = Status::success;
  if (!movers_.used) return report;
  corrector_.forget_stop();
  const OwnedVector y = copy_of(yy), ydot = copy_of(yp);
  try {
    report.residual_before = largest_residual(how, t0, yy, yp);
    settle_start(t0, y, ydot, how, report);
    note_changes(report, yy, y, yp, ydot);
    report.residual_after = largest_residual(how, t0, y, ydot);
  } catch (const NoStart& failure) {
    IDAReInit(ida_.mem(), t0, yy, yp);  // as the caller had it
    report.status = failure.status;
    report.message = failure.text;
    return report;
  }
  N_VScale(1.0, y, yy);
  N_VScale(1.0, ydot, yp);
  IDAReInit(ida_.mem(), t0, yy, yp);
  reset_statistics();
  return report;
}

void Projection::Impl::note_changes(ConsistencyReport& report, N_Vector yy, N_Vector y, N_Vector yp,
                                    N_Vector ydot) const {
  OwnedVector change(yy);
  N_VLinearSum(1.0, y, -1.0, yy, change);
  const int n = unknowns_.contiguous ? unknowns_.count : 0;
  report.move = N_VWrmsNorm(change, unknowns_.weights);
  report.largest_change = largest_change(yy, y, n, &report.changed_component);
  if (yp != nullptr) report.derivative_change = largest_change(yp, ydot, n, nullptr);
}

ConsistencyReport Projection::Impl::project(double t, N_Vector yy, N_Vector yp) {
  if (yy == nullptr) reject("project: yy must not be null");
  ConsistencyReport report;
  report.status = Status::success;
  if (!movers_.used) return report;
  current_weights(yy);
  const OwnedVector y = copy_of(yy), ydot = copy_of(yp);
  point_.project(t, y, {}, variables_.id(), unknowns_.weights, report);
  const bool turned = report.status == Status::success && ydot &&
                      point_.tangent(t, y, ydot, variables_.id(), report);
  if (report.status != Status::success) return report;
  note_changes(report, yy, y, turned ? yp : nullptr, ydot);
  N_VScale(1.0, y, yy);
  if (turned) N_VScale(1.0, ydot, yp);
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
  if (!report_of("solve", {}, [&] { return project(*tret, yret, ypret); })) return flag;
  report_.status = of_step;
  report_.message = text;
  return flag;
}

}  // namespace tether::ida_projection
