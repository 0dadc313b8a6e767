// Tether: a smooth system in the hands of IDA and the projection. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "bounds.hpp"
#include "mechanics/roots.hpp"
#include "newton_matrix.hpp"
#include "sundials/ida_session.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

/// One run of IDA from a point on. Its steps depend on that point alone, never on the times
/// that it is asked for: they are interpolated.
class Integrator : public IdaEquations {
 public:
  /// `y` and `yp` are consistent up to errors that `make_consistent` repairs.
  Integrator(System& system, const SmoothOptions& options, double t, const Eigen::VectorXd& y,
             const Eigen::VectorXd& yp)
      : IdaEquations(local_tolerance(options),
                     system.absolute_tolerances(local_tolerance(options))),
        system_(system),
        options_(options),
        t_(t),
        spent_(system.effect_names().size()) {
    const Eigen::VectorXd id = system.id();
    const IdaSession::Start start{t, y, yp, id};
    session_.emplace(context_, start, *this, options.max_step);
    system.choose_rows(t, y.data(), tolerance());
    session_->set_first_step(
        first_step(tolerance(), kInfinity, id, start,
                   [&](double at, Eigen::VectorXd& ahead, Eigen::VectorXd& rate) {
                     system_.complete(at, ahead, rate);
                   }));
    matrix_.emplace(system, t, session_->y(), session_->yp(), context_);
    session_->use(matrix_->solver(), matrix_->matrix());
    // Multipliers are derived quantities in every form: IDA judges the motion.
    session_->check(IDASetSuppressAlg(session_->ida(), 1), "IDASetSuppressAlg");
    session_->set_newton(kNewton);
    if (options.projection) {
      ida_projection::Options projection;
      // Close to singular positions F responds to any move, without being stiff: no other metric is
      // to be tried.
      projection.advanced.metric = ida_projection::Metric::local_correction;
      // Errors then follow the tolerance; by IDA's own rule one tolerance in ten ends twenty times
      // worse than its neighbours where singular positions magnify errors.
      projection.step_smoothing = true;
      // Without its refresh the noise of index 1's multipliers grows until Newton fails.
      projection.advanced.polish = options.formulation == Formulation::index1
                                       ? ida_projection::Polished::all
                                       : ida_projection::Polished::differential;
      projection.suppress_algebraic = false;  // IDASetSuppressAlg above stands
      projection.progress = [this](const ida_projection::Progress&) {
        system_.choose_rows_after_step();
      };
      session_->project(system.constraints(), projection);
    }
  }
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Moves y onto the constraints. Only with the projection.
  ida_projection::ConsistencyReport make_consistent(double t) {
    ida_projection::Consistency how;
    how.derivative = ida_projection::Consistency::Derivative::keep;  // System::complete knows it
    return session_->projection()->make_consistent(t, session_->y(), session_->yp(), how);
  }
  /// Whether it is at t; else it stands at the end of a step before t, where it is time for an
  /// anchor, or where `interrupted`. `steps_left` counts down; at 0, as for any failure of IDA,
  /// SimulationError.
  bool advance(double t, long& steps_left, const std::function<bool()>& interrupted) {
    if (t - t_ <= 1e-13 * std::abs(t)) return true;
    const double begin = now();
    const double from = t_;
    int flag = step_past(t, steps_left, interrupted);
    const double to = std::min({t, step_end(), above_from_});
    if (flag == IDA_SUCCESS && to > from) {
      flag = session_->solve(to, t_, IDA_NORMAL);
      // IDA has nothing to do where its last step has just ended and leaves y as the corrector
      // summed it; who comes from a time within that step reads it from the history, by other
      // roundings.
      if (flag >= 0 && to == step_end()) IDAGetDky(session_->ida(), to, 0, session_->y());
      // y' between steps is not used.
      if (session_->projection() != nullptr && flag >= 0)
        session_->projection()->project(t_, session_->y(), nullptr);
    } else if (flag == IDA_SUCCESS && step_end() > to) {  // it is above at once
      t_ = to;
      IDAGetDky(session_->ida(), to, 0, session_->y());
    }
    spent_.total += now() - begin;
    if (flag < 0) throw SimulationError(failure(flag));
    return t_ >= t;
  }
  /// From here on it stands where a function of (t, y) is above 0 first; empty: nowhere.
  using OfState = std::function<double(double, const Eigen::VectorXd&)>;
  void stop_above(OfState excess) { excess_ = std::move(excess); }
  bool is_above() const { return above_from_ <= t_; }
  double time() const { return t_; }
  /// The end of the last step, which may lie beyond time().
  bool anchor_is_due() const {
    return steps() >= kAnchor && system_.weakest_pivot() > kAnchorPivot;
  }
  long steps() const {
    long steps = 0;
    IDAGetNumSteps(session_->ida(), &steps);
    return steps;
  }
  double step_end() const {
    if (steps() == 0) return t_;
    double end = t_;
    IDAGetCurrentTime(session_->ida(), &end);
    return end;
  }
  Eigen::VectorXd at_step_end() const {
    Eigen::VectorXd y;
    session_->at(step_end(), y);
    return y;
  }
  Eigen::Map<const Eigen::VectorXd> y() const {
    return {N_VGetArrayPointer(session_->y()), system_.size()};
  }
  Counts counts() const { return session_->counts(); }

  struct Seconds {                // on the clock
    std::vector<double> effects;  ///< as System::effect_names()
    double jacobian = 0, projection = 0, total = 0;
  };
  Seconds seconds() const {
    Seconds s;
    s.effects = spent_.effects.seconds;
    if (spent_.timed > 0)
      for (double& each : s.effects)
        each *= static_cast<double>(spent_.residuals) / static_cast<double>(spent_.timed);
    s.jacobian = spent_.jacobian;
    if (session_->projection() != nullptr)
      s.projection = session_->projection()->statistics().seconds;
    s.total = spent_.total;
    return s;
  }

 private:
  // IDA bounds the error of each step; a run's error grows with the number of steps, which is about
  // tolerance^(-1/6). With this, and a tenth of the wanted error at 1e-4, slider-crank and four-bar
  // stay below ten times the tolerance after 10 s.
  static double local_tolerance(const SmoothOptions& options) {
    const double wanted = 0.1 * options.tolerance;
    const double tighter = std::min(1.0, std::pow(options.tolerance / 1e-4, 1.0 / 6.0));
    // Below the first rounding decides, not the number of steps.
    return std::max({tighter * wanted, std::min(wanted, 1e-11), 1e-13});
  }

  // Noise of velocities across the joints, times pivot^2; see widening().
  static constexpr double kNoise = 3e-14, kSmallestPivot = 3e-3;

  // An anchor is not close to a singular position, where y' and the multipliers are badly known.
  static constexpr double kAnchorPivot = 0.01;

  static double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }

  void residual(double t, const double* y, const double* yp, double* r) override {
    // Reading clocks costs as much as a small effect, so few evaluations are timed.
    const bool timed = (spent_.residuals++ & 31) == 0;
    spent_.timed += timed;
    system_.residual(t, y, yp, r, timed ? &spent_.effects : nullptr);
  }
  void jacobian(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J) override {
    const double begin = now();
    matrix_->fill(t, cj, y, yp, J);
    spent_.jacobian += now() - begin;
  }
  // Near a singular position velocities across the joints are known to round-off / pivot^2 only,
  // and no step size makes them better: what cannot be had is not asked for.
  double widening() const override {
    const double pivot = std::max(system_.weakest_pivot(), kSmallestPivot);
    return std::max(1.0, kNoise / (pivot * pivot * tolerance()));
  }
  // Step by step up to t. IDA's own way to an output time takes the same steps.
  int step_past(double t, long& steps_left, const std::function<bool()>& interrupted) {
    while (step_end() < std::min(t, above_from_) && !anchor_is_due() &&
           !(interrupted && interrupted())) {
      if (steps_left <= 0) {
        context_.message() =
            "max_steps = " + std::to_string(options_.max_steps) + " steps are taken.";
        return IDA_TOO_MUCH_WORK;
      }
      const long before = steps();
      const double begin = step_end();
      const double kink = system_.next_kink(step_end());
      if (std::isfinite(kink))  // no step passes over one
        session_->set_stop(kink);
      const int flag = session_->solve(t, t_, IDA_ONE_STEP);
      if (flag < 0) return flag;
      steps_left -= steps() - before;
      if (excess_)
        above_from_ = first_above(
            [&](double time) {
              Eigen::VectorXd y;
              session_->at(time, y);
              return excess_(time, y);
            },
            begin, step_end());
    }
    return IDA_SUCCESS;
  }
  std::string failure(int flag) const {
    double h = 0;
    IDAGetLastStep(session_->ida(), &h);
    std::string message =
        fmt::format("the smooth engine stopped at t = {:.6g} s (last step {:.3g} s): {}. ",
                    system_.units().time * t_, system_.units().time * h, IdaSession::name(flag));
    if (!context_.message().empty()) message += "IDA: " + context_.message() + " ";
    const ida_projection::Projection* projection = session_->projection();
    if (projection != nullptr && projection->status() != ida_projection::Status::success &&
        !projection->message().empty())
      message += "Projection: " + projection->message() + ". ";
    const std::vector<std::string> joints = system_.dependent_joints(t_, y().data());
    for (std::size_t k = 0; k < joints.size(); ++k) {
      if (k == kMostNamed) {
        message += " and " + std::to_string(joints.size() - kMostNamed) + " more";
        break;
      }
      message += (k == 0 ? "Joints \"" : ", \"") + joints[k] + "\"";
    }
    if (!joints.empty())
      message +=
          " depend on each other there, at a singular position: they hold the bodies fast whatever "
          "pulls at "
          "them, or let them go on in two ways. Move a body out of it a little. ";
    message +=
        "Try a smaller [smooth] tolerance or max_step; check whether the joints let the bodies "
        "reach "
        "a position from which they cannot go on, and whether a spring or a motion is too stiff or "
        "too fast.";
    if (projection == nullptr)
      message += " With projection = true the joints and invariants are kept.";
    return message;
  }

  struct Spent {  // seconds on the clock; of the effects in `timed` of all residuals
    explicit Spent(std::size_t parts) : effects(parts) {}
    Stopwatch effects;
    double jacobian = 0, total = 0;
    long residuals = 0, timed = 0;
  };

  System& system_;
  SmoothOptions options_;
  double t_;
  OfState excess_;
  double above_from_ = kInfinity;
  QuietContext context_;
  std::optional<NewtonMatrix> matrix_;
  std::optional<IdaSession> session_;
  Spent spent_;
};

}  // namespace tether::scene::smooth
