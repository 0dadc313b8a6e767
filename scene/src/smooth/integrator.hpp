// Tether: a smooth system in the hands of IDA and the projection. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

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
             const Eigen::VectorXd& yp);
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Moves y onto the constraints. Only with the projection.
  ida_projection::ConsistencyReport make_consistent(double t);
  /// Whether it is at t; else it stands at the end of a step before t, where it is time for an
  /// anchor, or where `interrupted`. `steps_left` counts down; at 0, as for any failure of IDA,
  /// SimulationError.
  bool advance(double t, long& steps_left, const std::function<bool()>& interrupted);
  /// From here on it stands where a function of (t, y) is above 0 first; empty: nowhere.
  using OfState = std::function<double(double, const Eigen::VectorXd&)>;
  void stop_above(OfState excess) { excess_ = std::move(excess); }
  bool is_above() const { return above_from_ <= t_; }
  double time() const { return t_; }
  /// The end of the last step, which may lie beyond time().
  bool anchor_is_due() const;
  long steps() const;
  double step_end() const;
  Eigen::VectorXd at_step_end() const;
  Eigen::Map<const Eigen::VectorXd> y() const;
  Counts counts() const { return session_->counts(); }

  struct Seconds {                // on the clock
    std::vector<double> effects;  ///< as System::effect_names()
    double jacobian = 0, projection = 0, total = 0;
  };
  Seconds seconds() const;

 private:
  void residual(double t, const double* y, const double* yp, double* r) override;
  void jacobian(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J) override;
  double widening() const override;
  int step_past(double t, long& steps_left, const std::function<bool()>& interrupted);
  std::string failure(int flag) const;

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
