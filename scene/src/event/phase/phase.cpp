// Tether: one smooth phase in the hands of IDA and the projection. SPDX-License-Identifier:
// BSD-3-Clause
#include "phase.hpp"
#include "friction_solve.hpp"

#include <fmt/format.h>
#include <sunmatrix/sunmatrix_dense.h>

namespace tether::scene::event {

namespace {

constexpr double kLargestSlipChange = 0.5;    // of a slip, since Newton's matrix was made
constexpr double kLargestStateChange = 1e-5;  // of the state, since d(y')/dy was found

}  // namespace

Phase::Phase(Motion& motion, double tolerance, double max_step, double t, const VectorXd& y,
             double longest_first, double length)
    : IdaEquations(tolerance, VectorXd::Constant(motion.size(), tolerance)),
      motion_(motion),
      start_(t),
      length_(length),
      rate_(motion.size()) {
  const int N = motion.size();
  VectorXd yp(N);
  motion.rate(start_, y.data(), yp.data());
  const VectorXd id = VectorXd::Ones(N);
  const IdaSession::Start start{0, y, yp, id};
  session_.emplace(context_, start, *this, max_step);
  const double h = first_step(tolerance, 0.1, id, start,  // at most a tenth of its time unit
                              [&](double at, VectorXd& ahead, VectorXd& rate_ahead) {
                                motion.rate(start_ + at, ahead.data(), rate_ahead.data());
                              });
  session_->set_first_step(longest_first > 0 ? std::min(h, longest_first) : h);
  matrix_.reset(SUNDenseMatrix(N, N, context_));
  solver_ = dense_solver(session_->y(), matrix_.get(), context_);
  session_->use(solver_.get(), matrix_.get());
  session_->set_newton(kNewton);
  project();
  if (std::isfinite(length_)) session_->set_stop(length_);
}

// The force of a slip s turns with 1 / |s|.
bool Phase::has_turned(double t, N_Vector y) {
  motion_.slips_with_friction(start_ + t, N_VGetArrayPointer(y), slips_);
  for (Eigen::Index k = 0; k < slips_.size(); k += kTangents) {
    const auto now = slips_.segment(k, kTangents), then = slips_of_matrix_.segment(k, kTangents);
    if ((now - then).norm() > kLargestSlipChange * std::min(now.norm(), then.norm())) return true;
  }
  return false;
}

void Phase::project() {
  ida_projection::Constraints constraints;
  constraints.count = motion_.constraint_count();
  if (constraints.count == 0) return;
  constraints.value = [this](double t, ida_projection::ConstVector at, ida_projection::Vector g) {
    motion_.constraints(start_ + t, at.data(), g.data());
  };
  constraints.jacobian = ida_projection::DenseJacobian(
      [this](double t, ida_projection::ConstVector at, ida_projection::Matrix C) {
        motion_.constraint_gradient(start_ + t, at.data(), C);
      });
  ida_projection::Options options;
  options.advanced.smooth_where_needed = false;  // F gives all of y': its index need not be found
  session_->project(constraints, options);
}

// The first steps of a phase move the state by nothing: what changes is cj. Where IDA asks twice at
// one time its corrector has failed.
bool Phase::may_reuse(double t, N_Vector y) {
  const bool failed = t == asked_time_;
  asked_time_ = t;
  if (failed || slope_at_.size() == 0) return false;
  for (Eigen::Index i = 0; i < slope_at_.size(); ++i) {
    const double there = N_VGetArrayPointer(y)[i];
    if (!(std::abs(there - slope_at_[i]) <= kLargestStateChange * (1 + std::abs(there))))
      return false;
  }
  return !has_turned(t, y);
}

// By differences: Newton's matrix decides how fast it converges, not where to.
void Phase::differentiate(double t, const double* y) {
  const int N = motion_.size();
  motion_.slips_with_friction(start_ + t, y, slips_of_matrix_);
  VectorXd near = Eigen::Map<const VectorXd>(y, N), near_rate = VectorXd::Zero(N);
  slope_at_ = near;
  motion_.rate(start_ + t, near.data(), rate_.data());
  // Friction turns with the slip: differences are short against it.
  const double longest = 1e-3 * motion_.smallest_slip();
  slope_.setZero(N, N);
  for (int j = 0; j < N; ++j) {
    if (j == motion_.work()) continue;
    double step = 1e-7 * std::max(1.0, std::abs(slope_at_[j]));  // the root of rounding
    if (j >= motion_.coordinates()) step = std::min(step, longest);
    near[j] = slope_at_[j] + step;
    motion_.rate(start_ + t, near.data(), near_rate.data());
    near[j] = slope_at_[j];
    slope_.col(j) = (near_rate - rate_) / step;
  }
}

// cj - d(y')/dy
void Phase::jacobian(double t, double cj, N_Vector y, N_Vector, SUNMatrix J) {
  if (!may_reuse(t, y)) differentiate(t, N_VGetArrayPointer(y));
  const int N = motion_.size();
  Eigen::Map<MatrixXd> out(SUNDenseMatrix_Data(J), N, N);
  out = -slope_;
  out.diagonal().array() += cj;
}

void Phase::step() {
  double t = 0;
  const int flag = session_->solve(end_ + 1, t, IDA_ONE_STEP);
  if (flag < 0) {
    const double unit = motion_.model().time_unit();
    std::string text = fmt::format(
        "the event engine's smooth phase that began at t = {:.9g} s stopped {:.3g} s "
        "later: {}. {}",
        unit * start_, unit * end_, IdaSession::name(flag), context_.message());
    const ida_projection::Projection* projection = session_->projection();
    if (projection != nullptr && !projection->message().empty())
      text += " Projection: " + projection->message();
    throw SimulationError(text + " Try another [event] tolerance.");
  }
  begin_ = end_;
  end_ = t;
}

// Newton's shortest moves, until they are a thousandth of the tolerance; few, since only what an
// event left is mended.
bool move_onto_constraints(Motion& motion, double tolerance, double t, VectorXd& y) {
  const int m = motion.constraint_count();
  if (m == 0) return true;
  VectorXd g(m);
  Eigen::Matrix<double, -1, -1, Eigen::RowMajor> C(m, motion.size());
  double before = 0;
  for (int pass = 0; pass < 12; ++pass) {
    motion.constraints(t, y.data(), g.data());
    if (!g.allFinite()) return false;
    C.setZero();
    motion.constraint_gradient(t, y.data(), C);
    linalg::LeastSquares factor(kDependent);
    factor.factor(C);
    const VectorXd move = factor.solve(g);
    y -= move;
    const double size = 1 + y.cwiseAbs().maxCoeff();
    const double moved = move.cwiseAbs().maxCoeff();
    // The rest is rounding of gaps, which for large fixed bodies exceeds that of coordinates.
    const bool rounding = pass > 0 && moved >= 0.5 * before && moved <= 0.1 * tolerance * size;
    if (moved <= 1e-3 * tolerance * size || rounding) return true;
    before = moved;
  }
  return false;
}

}  // namespace tether::scene::event
