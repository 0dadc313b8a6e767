// Tether: initial values on the constraints and consistent with F. SPDX-License-Identifier:
// BSD-3-Clause
#include "start/consistent_start.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/least_squares.hpp>
#include <utility>

#include "host/rounding.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kLead = 2e-3;  // of the way to tout, of which IDA's first step is a thousandth

// Time that a probe spans.
double tiny(double t0) { return 1e-8 * std::max(1.0, std::abs(t0)); }

// Why there is no consistent start; ends make().
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

Eigen::Map<Eigen::VectorXd> entries_of(N_Vector v) {
  return {N_VGetArrayPointer(v), static_cast<Eigen::Index>(N_VGetLength(v))};
}

// Gauss-Newton on F(t, y, y') = 0 over z = (y'_i differential, y_i algebraic), each correction the
// least-squares solution of minimum norm (complete orthogonal decomposition), so redundant
// multipliers and rows are allowed. Jacobian by differences. `id`: 1 differential, 0 algebraic,
// null: all differential. Contiguous vectors. y and yp change only if F becomes small.
bool solve_least_squares(const Consistency& how, double t, N_Vector y, N_Vector yp, N_Vector id,
                         N_Vector weights) {
  const OwnedVector y_new = copy_of(y), yp_new = copy_of(yp), F(y), F_shifted(y);
  auto values = entries_of(y_new), slopes = entries_of(yp_new);
  const auto w = entries_of(weights);
  const Eigen::Index n = values.size();
  const double* mask = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
  const auto unknown = [&](Eigen::Index j) -> double& {
    return mask != nullptr && mask[j] == 0.0 ? values[j] : slopes[j];
  };
  const auto evaluate = [&](N_Vector into) {
    const int flag = how.residual(t, y_new, yp_new, into, how.user_data);
    if (flag < 0) throw residual_ended();
    return flag == 0;
  };
  if (!evaluate(F)) return false;
  Eigen::MatrixXd J(n, n);
  double previous = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < how.maximum_iterations; ++iteration) {
    Eigen::VectorXd scale(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      double& z = unknown(j);
      scale[j] = std::max({std::abs(z), w[j] > 0.0 ? 1.0 / w[j] : 0.0, 1e-12});
      const double kept = z;
      z = kept + std::sqrt(kEpsilon) * scale[j];
      const double increment = z - kept;
      if (!evaluate(F_shifted)) return false;
      J.col(j) = (entries_of(F_shifted) - entries_of(F)) / increment * scale[j];
      z = kept;
    }
    // Rows of F have their own units: each is scaled by its largest entry.
    Eigen::VectorXd rows = J.rowwise().lpNorm<Eigen::Infinity>();
    for (double& size : rows) size = size > 0.0 ? 1.0 / size : 1.0;
    linalg::LeastSquares factors(1e-7);  // differences carry about half the digits
    factors.factor(rows.asDiagonal() * J);
    const Eigen::VectorXd dz = factors.solve(rows.cwiseProduct(entries_of(F)));
    if (!dz.allFinite()) return false;
    for (Eigen::Index j = 0; j < n; ++j) unknown(j) -= scale[j] * dz[j];
    if (!evaluate(F)) return false;
    const double left = rows.cwiseProduct(entries_of(F)).lpNorm<Eigen::Infinity>();
    // dz is relative to the size of the unknowns: stop when it is rounding, or no longer shrinks.
    const double change = dz.lpNorm<Eigen::Infinity>();
    if (change <= 1e-12 || (change <= 1e-7 && change >= 0.3 * previous)) {
      if (!(left <= 1e-6)) return false;  // F = 0 has no solution near
      N_VScale(1.0, y_new, y);
      N_VScale(1.0, yp_new, yp);
      return true;
    }
    previous = change;
  }
  return false;
}

// Largest change of a component; `where` (may be null): which one, of contiguous vectors.
double largest_change(N_Vector from, N_Vector to, int* where) {
  const OwnedVector change(to);
  N_VLinearSum(1.0, to, -1.0, from, change);
  if (!is_contiguous(change)) return N_VMaxNorm(change);
  Eigen::Index j = 0;
  const double largest = entries_of(change).cwiseAbs().maxCoeff(&j);
  if (where != nullptr && largest > 0.0) *where = static_cast<int>(j);
  return largest;
}

}  // namespace

void note_changes(ConsistencyReport& report, N_Vector weights, N_Vector from, N_Vector y,
                  N_Vector from_p, N_Vector yp) {
  const OwnedVector change(y);
  N_VLinearSum(1.0, y, -1.0, from, change);
  report.move = N_VWrmsNorm(change, weights);
  report.largest_change = largest_change(from, y, &report.changed_component);
  if (yp != nullptr) report.derivative_change = largest_change(from_p, yp, nullptr);
}

struct ConsistentStart::Inquiry {
  double t;
  N_Vector y;  // moved on success, where rows contain algebraic variables of F
  const std::vector<bool>& hold;
  ConsistencyReport report;  // of that move
  bool answered = false;
};

// Error weights, algebraic variables, and the move by rows that are solved together with equations
// of F, while IDA's residual callback is available.
std::string ConsistentStart::answer(Candidate& candidate) {
  N_VScale(1.0, candidate.weights, weights_);
  std::string advice = variables_.derive(candidate, corrector_);
  joined_.join(candidate);
  if (joined_.rows() != nullptr) {
    PointProjection point(joined_.constraints(), options_);
    point.project(inquiry_->t, inquiry_->y, inquiry_->hold, joined_.moved_id(), weights_,
                  inquiry_->report);
  }
  joined_.forget();
  inquiry_->answered = true;
  return advice;
}

// Lets IDA attempt a step in which the inquiry is answered. IDA must be reinitialised afterwards.
// It refuses, with errors on stderr, a step away from a stop time, which no getter tells. One that
// was reached is at t0: from just before t0 it lies ahead. Where no step has led to t0 F may
// have no value there.
bool ConsistentStart::probe(double t0, N_Vector yy, N_Vector yp, Inquiry& inquiry) {
  const OwnedVector y = copy_of(yy), ydot = copy_of(yp);
  inquiry_ = &inquiry;
  for (const double direction : {1.0, -1.0}) {
    const double start = t0 - direction * (direction < 0.0 ? kLead : lead_) * tiny(t0);
    sunrealtype reached = start;
    if (IDAReInit(ida_.mem(), start, yy, yp) != 0) break;
    const int flag =
        IDASolve(ida_.mem(), start + direction * tiny(t0), &reached, y, ydot, IDA_ONE_STEP);
    if (inquiry.answered || flag != IDA_ILL_INPUT) break;
  }
  inquiry_ = nullptr;
  return inquiry.answered;
}

// Makes y' and the algebraic variables consistent with F.
void ConsistentStart::find_derivative(double t0, N_Vector y, N_Vector ydot,
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
  if (how.derivative != Derivative::calc_ic && how.residual != nullptr && is_contiguous(y) &&
      solve_least_squares(how, t0, y, ydot, variables_.vector(), weights_))
    return;
  throw NoStart{Status::not_converged,
                "y' consistent with F was not found; give Options::id and Consistency::residual, "
                "or keep y' with Consistency::Derivative::keep"};
}

// Moves y onto the constraints; algebraic variables only if rows or F determine them. `jointly`: by
// rows that were solved together with equations of F.
ConsistencyReport ConsistentStart::project(double t0, N_Vector y, N_Vector ydot,
                                           const Consistency& how, bool* jointly) {
  Inquiry joint{t0, y, how.hold, {}};
  if (!probe(t0, y, ydot, joint))
    throw NoStart{Status::internal_error,
                  "IDA could not be started at the given values; set tolerances and the linear "
                  "solver before make_consistent, and read IDA's own message"};
  if (corrector_.stopped()) throw NoStart{Status::callback_fatal, corrector_.stop_text()};
  *jointly = joint.report.status != Status::unused;
  if (joint.report.status != Status::success)
    point_.project(t0, y, how.hold, variables_.id(), weights_, joint.report);
  return joint.report;
}

// Far from consistent algebraic variables, rows that repeat equations of F act as conditions on the
// other variables. Algebraic variables therefore move first if that moves the others less.
bool ConsistentStart::move_algebraic_first(double t0, N_Vector start, N_Vector y, N_Vector ydot,
                                           const Consistency& how, ConsistencyReport& report) {
  const N_Vector id = variables_.id();
  if (id == nullptr || !how.hold.empty() || !options_.hold.empty()) return false;
  const OwnedVector near = copy_of(start), slope = copy_of(ydot), way(y);
  const auto moved = [&](N_Vector to) {
    N_VLinearSum(1.0, to, -1.0, start, way);
    return N_VWrmsNormMask(way, weights_, id);
  };
  bool jointly = false;
  try {
    find_derivative(t0, near, slope, how);
    const ConsistencyReport other = project(t0, near, slope, how, &jointly);
    if (!(moved(near) < 0.5 * moved(y))) return false;
    report = other;
  } catch (const NoStart&) {
    return false;
  }
  N_VScale(1.0, near, y);
  N_VScale(1.0, slope, ydot);
  return true;
}

// Alternates between rows that contain algebraic variables and the equations of F, until neither
// moves the point. The report has the length of the first projection and the last drift.
void ConsistentStart::settle(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                             ConsistencyReport& report) {
  constexpr double kSettled = 1e-3;  // tolerances
  for (int round = 0; round < 8; ++round) {
    const OwnedVector before = copy_of(y);
    bool jointly = false;
    ConsistencyReport now = project(t0, y, ydot, how, &jointly);
    if (round == 0 && jointly) move_algebraic_first(t0, before, y, ydot, how, now);
    if (round == 0) report = now;
    report.drift_after = now.drift_after;
    if (corrector_.stopped()) throw NoStart{Status::callback_fatal, corrector_.stop_text()};
    if (now.status != Status::success) throw NoStart{now.status, now.message};
    N_VLinearSum(1.0, y, -1.0, before, before);
    if (round > 0 && N_VWrmsNorm(before, weights_) <= kSettled) return;
    find_derivative(t0, y, ydot, how);
    if (how.derivative == Consistency::Derivative::keep) return;
  }
  throw NoStart{Status::not_converged,
                "the algebraic variables that F asks for move y off the constraints again and "
                "again; start closer, or give rows without algebraic variables"};
}

ConsistencyReport ConsistentStart::make(double t0, N_Vector yy, N_Vector yp, const Consistency& how,
                                        N_Vector weights, double reached) {
  weights_ = weights;
  lead_ = std::abs(t0 - reached) <= tiny(t0) ? kLead : 0.0;
  corrector_.forget_stop();
  const OwnedVector y = copy_of(yy), ydot = copy_of(yp);
  ConsistencyReport report;
  double residual_before = -1.0;
  try {
    residual_before = largest_residual(how, t0, yy, yp);
    settle(t0, y, ydot, how, report);
    note_changes(report, weights_, yy, y, yp, ydot);
    report.residual_after = largest_residual(how, t0, y, ydot);
    N_VScale(1.0, y, yy);
    N_VScale(1.0, ydot, yp);
  } catch (const NoStart& failure) {
    report.status = failure.status;
    report.message = failure.text;
  }
  report.residual_before = residual_before;
  IDAReInit(ida_.mem(), t0, yy, yp);  // where that failed, as the caller had it
  return report;
}

}  // namespace tether::ida_projection
