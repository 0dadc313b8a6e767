// Tether: one smooth phase in the hands of IDA and the projection. SPDX-License-Identifier:
// BSD-3-Clause
#include "phase.hpp"

#include <fmt/format.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include "sundials/ida_session.hpp"

namespace tether::scene::event {

namespace {

constexpr double kLongestFirstStep = 0.1;
constexpr double kIncrement = 1e-7, kLargestIncrement = 1e-3;
constexpr double kLargestSlipChange = 0.5;    // of a slip, since Newton's matrix was made
constexpr double kLargestStateChange = 1e-5;  // of the state, since d(y')/dy was found

#if SUNDIALS_VERSION_MAJOR >= 7
using Flag = sunbooleantype;
#else
using Flag = booleantype;
#endif

}  // namespace

struct Phase::Ida {
  Ida(Motion& of, double tol, double max_step, double start_time, const VectorXd& y0,
      double longest_first);

  static int weights(N_Vector y, N_Vector w, void* self);
  double size_of(int i, double value) const { return sizes[i] + std::abs(value); }
  static int residual(double t, N_Vector y, N_Vector yp, N_Vector r, void* self);
  static int jacobian(double t, double cj, N_Vector y, N_Vector yp, N_Vector r, SUNMatrix J,
                      void* self, N_Vector, N_Vector, N_Vector);
  static int newton(SUNNonlinearSolver solver, N_Vector predicted, N_Vector correction,
                    N_Vector weights, double tolerance, Flag renew, void* ida);
  bool has_turned(double t, N_Vector predicted);
  bool may_reuse(double t, N_Vector at);
  void differentiate(double t, const double* from);

  Motion& motion;
  double tolerance, start;
  QuietContext context;
  OwnedMatrix matrix;
  OwnedLinearSolver solver;
  OwnedCorrector corrector;
  decltype(SUNNonlinearSolver {} -> ops->solve) iterate = nullptr;  // SUNDIALS' Newton
  std::optional<IdaSession> session;
  VectorXd rate, near, near_rate, sizes;
  VectorXd slips, slips_of_matrix;
  MatrixXd slope;  // d(y')/dy at
  VectorXd slope_at;
  double asked_time = -1;
};

Phase::Ida::Ida(Motion& of, double tol, double max_step, double start_time, const VectorXd& y0,
                double longest_first)
    : motion(of), tolerance(tol), start(start_time) {
  const int N = motion.size();
  sizes = motion.model().sizes();
  rate.setZero(N);
  near_rate.setZero(N);
  VectorXd rate0(N);
  motion.rate(start, y0.data(), rate0.data());
  const VectorXd id = VectorXd::Ones(N);
  session.emplace(context, IdaSession::Start{0, y0, rate0, id}, residual, weights, this, max_step);
  const FirstStep first{tolerance, kLongestFirstStep, sizes,
                        [&](double at, VectorXd& ahead, VectorXd& rate_ahead) {
                          motion.rate(start + at, ahead.data(), rate_ahead.data());
                        }};
  const double h = first(0, y0, rate0);
  session->set_first_step(longest_first > 0 ? std::min(h, longest_first) : h);
  matrix.reset(SUNDenseMatrix(N, N, context));
  solver.reset(N <= ida_projection::kLargestFastDense
                   ? ida_projection::fast_dense_solver(session->y(), matrix.get())
                   : SUNLinSol_Dense(session->y(), matrix.get(), context));
  session->use(solver.get(), matrix.get(), jacobian);
  session->set_newton(kNewton);
  corrector.reset(SUNNonlinSol_Newton(session->y(), context));
  iterate = corrector->ops->solve;
  corrector->ops->solve = newton;
  ida_projection::Constraints constraints;
  constraints.count = motion.constraint_count();
  if (constraints.count == 0) {
    session->check(IDASetNonlinearSolver(session->ida(), corrector.get()), "IDASetNonlinearSolver");
    return;
  }
  constraints.value = [this](double t, ida_projection::ConstVector at, ida_projection::Vector g) {
    motion.constraints(start + t, at.data(), g.data());
  };
  constraints.jacobian = ida_projection::DenseJacobian(
      [this](double t, ida_projection::ConstVector at, ida_projection::Matrix C) {
        motion.constraint_gradient(start + t, at.data(), C);
      });
  ida_projection::Options options;
  options.nonlinear_solver = corrector.get();
  session->project(constraints, options);
}

int Phase::Ida::weights(N_Vector y, N_Vector w, void* self) {
  const Ida& me = *static_cast<Ida*>(self);
  for (int i = 0; i < me.sizes.size(); ++i)
    N_VGetArrayPointer(w)[i] =
        1 / (me.tolerance * std::abs(N_VGetArrayPointer(y)[i]) + me.tolerance * me.sizes[i]);
  return 0;
}

int Phase::Ida::residual(double t, N_Vector y, N_Vector yp, N_Vector r, void* self) {
  Ida& me = *static_cast<Ida*>(self);
  me.motion.rate(me.start + t, N_VGetArrayPointer(y), me.rate.data());
  const double* derivative = N_VGetArrayPointer(yp);
  double* out = N_VGetArrayPointer(r);
  double sum = 0;
  for (int i = 0; i < me.rate.size(); ++i) sum += out[i] = derivative[i] - me.rate[i];
  return std::isfinite(sum) ? 0 : 1;
}

// The force of a slip s turns with 1 / |s|. A matrix of a slip that was far shorter takes errors
// across it for small ones: Newton's test lets them pass.
bool Phase::Ida::has_turned(double t, N_Vector predicted) {
  motion.slips_with_friction(start + t, N_VGetArrayPointer(predicted), slips);
  const Eigen::Index n = motion.model().tangents();
  for (Eigen::Index k = 0; k < slips.size(); k += n) {
    const auto now = slips.segment(k, n), then = slips_of_matrix.segment(k, n);
    if ((now - then).norm() > kLargestSlipChange * std::min(now.norm(), then.norm())) return true;
  }
  return false;
}

int Phase::Ida::newton(SUNNonlinearSolver solver, N_Vector predicted, N_Vector correction,
                       N_Vector weights, double tolerance, Flag renew, void* ida) {
  double t = 0, cj = 0;
  N_Vector yy, yp, at, rate, r;
  void* self = nullptr;
  IDAGetNonlinearSystemData(ida, &t, &yy, &yp, &at, &rate, &r, &cj, &self);
  Ida& me = *static_cast<Ida*>(self);
  if (me.slips_of_matrix.size() > 0 && me.has_turned(t, predicted)) renew = SUNTRUE;
  return me.iterate(solver, predicted, correction, weights, tolerance, renew, ida);
}

// The first steps of a phase move the state by nothing: what changes is cj. Where IDA asks twice at
// one time its corrector has failed.
bool Phase::Ida::may_reuse(double t, N_Vector at) {
  const bool failed = t == asked_time;
  asked_time = t;
  if (failed || slope_at.size() == 0) return false;
  for (Eigen::Index i = 0; i < slope_at.size(); ++i) {
    const double there = N_VGetArrayPointer(at)[i];
    if (!(std::abs(there - slope_at[i]) <=
          kLargestStateChange * size_of(static_cast<int>(i), there)))
      return false;
  }
  return !has_turned(t, at);
}

void Phase::Ida::differentiate(double t, const double* from) {
  const int N = motion.size();
  motion.slips_with_friction(start + t, from, slips_of_matrix);
  near = slope_at = Eigen::Map<const VectorXd>(from, N);
  motion.rate(start + t, near.data(), rate.data());
  // Friction turns with the slip: differences are short against it.
  const double longest = kLargestIncrement * motion.smallest_slip();
  slope.setZero(N, N);
  for (int j = 0; j < N; ++j) {
    if (j == motion.work()) continue;
    const double kept = near[j];
    double step = kIncrement * std::max(sizes[j], std::abs(kept));
    if (j >= motion.coordinates()) step = std::min(step, longest);
    near[j] = kept + step;
    motion.rate(start + t, near.data(), near_rate.data());
    near[j] = kept;
    slope.col(j) = (near_rate - rate) / step;
  }
}

// cj - d(y')/dy by differences: Newton's matrix decides how fast it converges, not where to.
int Phase::Ida::jacobian(double t, double cj, N_Vector y, N_Vector, N_Vector, SUNMatrix J,
                         void* self, N_Vector, N_Vector, N_Vector) {
  Ida& me = *static_cast<Ida*>(self);
  const int N = me.motion.size();
  if (!me.may_reuse(t, y)) me.differentiate(t, N_VGetArrayPointer(y));
  for (int j = 0; j < N; ++j) {
    Eigen::Map<VectorXd>(SM_COLUMN_D(J, j), N) = -me.slope.col(j);
    SM_ELEMENT_D(J, j, j) += cj;
  }
  return 0;
}

Phase::Phase(Motion& motion, double tolerance, double max_step, double t, const VectorXd& y,
             double longest_first, double length)
    : motion_(motion),
      tolerance_(tolerance),
      start_(t),
      length_(length),
      ida_(std::make_unique<Ida>(motion, tolerance, max_step, t, y, longest_first)) {
  if (std::isfinite(length_))
    ida_->session->check(IDASetStopTime(ida_->session->ida(), length_), "IDASetStopTime");
}

Phase::~Phase() = default;

void Phase::step() {
  double t = 0;
  const int flag = ida_->session->solve(end_ + 1, t, IDA_ONE_STEP);
  if (flag < 0) {
    const double unit = motion_.model().time_unit();
    std::string text = fmt::format(
        "the event engine's smooth phase that began at t = {:.9g} s stopped {:.3g} s "
        "later: {}. {}",
        unit * start_, unit * end_, IdaSession::name(flag), ida_->context.message());
    const ida_projection::Projection* projection = ida_->session->projection();
    if (projection != nullptr && !projection->message().empty())
      text += " Projection: " + projection->message();
    throw SimulationError(text + " Try another [event] tolerance.");
  }
  begin_ = end_;
  end_ = t;
}

void Phase::at(double time, VectorXd& y) const { ida_->session->at(time, y); }

bool Phase::projected_at(double time, VectorXd& y) { return ida_->session->projected_at(time, y); }

bool Phase::has_weak_rows() const {
  VectorXd y;
  at(end_, y);
  return motion_.other_joint_rows_are_better(start_ + end_, y);
}

Counts Phase::counts() const { return ida_->session->counts(); }

// Newton's shortest moves; few, since only what an event left is mended.
bool move_onto_constraints(Motion& motion, double tolerance, double t, VectorXd& y) {
  const int m = motion.constraint_count();
  if (m == 0) return true;
  const VectorXd sizes = motion.model().sizes();
  VectorXd g(m);
  Eigen::Matrix<double, -1, -1, Eigen::RowMajor> C(m, motion.size());
  double before = 0;
  for (int pass = 0; pass < 12; ++pass) {
    motion.constraints(t, y.data(), g.data());
    if (!g.allFinite()) return false;
    C.setZero();
    motion.constraint_gradient(t, y.data(), C);
    linalg::LeastSquares factor(1e-11);
    factor.factor(C * sizes.asDiagonal());
    const VectorXd move = factor.solve(g);
    y -= sizes.cwiseProduct(move);
    const double size = 1 + y.cwiseQuotient(sizes).cwiseAbs().maxCoeff();
    const double moved = move.cwiseAbs().maxCoeff();
    // The rest is rounding of gaps, which for large fixed bodies exceeds that of coordinates.
    const bool rounding = pass > 0 && moved >= 0.5 * before && moved <= 0.1 * tolerance * size;
    if (moved <= 1e-3 * tolerance * size || rounding) return true;
    before = moved;
  }
  return false;
}

}  // namespace tether::scene::event
