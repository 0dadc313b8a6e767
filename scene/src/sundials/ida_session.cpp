// Tether: a state in the hands of IDA and the projection. SPDX-License-Identifier: BSD-3-Clause
#include "ida_session.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>
#include <sunlinsol/sunlinsol_dense.h>

namespace tether::scene {

namespace {

constexpr double kDifferencePart = 1e-5;  // the part of a move over which y'' is differenced

int residual(double t, N_Vector y, N_Vector yp, N_Vector r, void* equations) {
  double* out = N_VGetArrayPointer(r);
  static_cast<IdaEquations*>(equations)->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp),
                                                  out);
  double sum = 0;
  for (sunindextype i = 0; i < N_VGetLength(r); ++i) sum += out[i];
  return std::isfinite(sum) ? 0 : 1;  // IDA tries a smaller step
}

int weights(N_Vector y, N_Vector weights, void* equations) {
  const auto& of = *static_cast<const IdaEquations*>(equations);
  const double widen = of.widening(), *values = N_VGetArrayPointer(y);
  double* out = N_VGetArrayPointer(weights);
  for (Eigen::Index i = 0; i < of.absolute().size(); ++i)
    out[i] = 1.0 / (widen * (of.tolerance() * std::abs(values[i]) + of.absolute()[i]));
  return 0;
}

int jacobian(double t, double cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J, void* equations,
             N_Vector, N_Vector, N_Vector) {
  static_cast<IdaEquations*>(equations)->jacobian(t, cj, y, yp, J);
  return 0;
}

}  // namespace

IdaSession::IdaSession(QuietContext& context, const Start& start, IdaEquations& equations,
                       double max_step)
    : context_(context), max_step_(max_step), ida_(IDACreate(context)) {
  if (ida_ == nullptr) throw std::bad_alloc();
  const auto N = start.y.size();
  y_.reset(ida_projection::fast_vector(N_VNew_Serial(N, context)));
  for (OwnedVector* each : {&yp_, &id_}) each->reset(N_VClone(y_.get()));
  const auto fill = [N](const OwnedVector& vector, const Eigen::VectorXd& values) {
    Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(vector.get()), N) = values;
  };
  fill(y_, start.y), fill(yp_, start.yp), fill(id_, start.id);
  context.keep_messages_of(ida_);
  check(IDAInit(ida_, residual, start.t, y(), yp()), "IDAInit");
  check(IDASetUserData(ida_, &equations), "IDASetUserData");
  check(IDAWFtolerances(ida_, weights), "IDAWFtolerances");
  check(IDASetMaxNumSteps(ida_, -1), "IDASetMaxNumSteps");
  check(IDASetId(ida_, id_.get()), "IDASetId");
  if (max_step > 0) check(IDASetMaxStep(ida_, max_step), "IDASetMaxStep");
}

void IdaSession::use(SUNLinearSolver solver, SUNMatrix matrix) {
  check(IDASetLinearSolver(ida_, solver, matrix), "IDASetLinearSolver");
  if (matrix != nullptr) check(IDASetJacFn(ida_, jacobian), "IDASetJacFn");
}

void IdaSession::project(const ida_projection::Constraints& constraints,
                         ida_projection::Options options) {
  options.id = id_.get();
  options.print = false;
  // A move that no smaller step makes shorter is part of what IDA's error test judges: rows that
  // come back behind a singular position, what an event left.
  options.advanced.long_move = ida_projection::LongMove::cap;
  options.advanced.maximum_step = max_step_;
  projection_.emplace(ida_, constraints, options);
}

void IdaSession::at(double time, Eigen::VectorXd& out) const {
  out.resize(N_VGetLength(y()));
  const OwnedVector vector(N_VMake_Serial(out.size(), out.data(), context_));
  IDAGetDky(ida_, time, 0, vector.get());
}

bool IdaSession::projected_at(double time, Eigen::VectorXd& out) {
  at(time, out);
  if (!projection_) return true;
  const OwnedVector vector(N_VMake_Serial(out.size(), out.data(), context_));
  return static_cast<bool>(projection_->project(time, vector.get()));
}

OwnedLinearSolver dense_solver(N_Vector y, SUNMatrix matrix, SUNContext context) {
  return OwnedLinearSolver(N_VGetLength(y) <= ida_projection::kLargestFastDense
                               ? ida_projection::fast_dense_solver(y, matrix)
                               : SUNLinSol_Dense(y, matrix, context));
}

double first_step(double tolerance, double longest, const Eigen::VectorXd& sizes,
                  const IdaSession::Start& start, const IdaRate& rate) {
  const Eigen::VectorXd &y = start.y, &yp = start.yp;
  double speed = 0;
  for (Eigen::Index i = 0; i < y.size(); ++i)
    if (sizes[i] != 0) speed = std::max(speed, std::abs(yp[i]) / (sizes[i] + std::abs(y[i])));
  if (!(speed > 0 && std::isfinite(speed))) return 1e-3;  // at rest, s
  const double span = kDifferencePart / speed;
  Eigen::VectorXd ahead = y + span * yp, there(y.size());
  rate(start.t + span, ahead, there);
  double sum = 0;
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    if (sizes[i] == 0) continue;
    const double change = (there[i] - yp[i]) / (tolerance * (sizes[i] + std::abs(y[i])));
    sum += change * change;
  }
  const double curvature = std::sqrt(sum / static_cast<double>(y.size())) / span;
  if (!std::isfinite(curvature)) return 0.5 * tolerance / speed;
  const double most = std::min(1e-2 / speed, longest);
  return curvature > 0 ? std::min(most, std::sqrt(4 * 0.125 / curvature)) : most;
}

}  // namespace tether::scene
