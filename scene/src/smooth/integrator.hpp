// Tether: a smooth system in the hands of IDA and the projection. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <functional>
#include <ida/ida.h>
#include <memory>
#include <optional>
#include <string>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <tether/ida_projection.hpp>

#include "sundials/quiet_context.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

/// One run of IDA from a point on. Its steps depend on that point alone, never on the times
/// that it is asked for: they are interpolated.
class Integrator {
 public:
  /// `y` and `yp` are consistent up to errors that `make_consistent` repairs.
  Integrator(System& system, const SmoothOptions& options, double t, const Eigen::VectorXd& y,
             const Eigen::VectorXd& yp);
  ~Integrator();
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Moves y onto the constraints. Only with the projection.
  ida_projection::ConsistencyReport make_consistent(double t);
  /// Whether it is at t; else it stands at the end of a step before t, where it is time for an
  /// anchor, or where `interrupted`. `steps_left` counts down; at 0, as for any failure of IDA,
  /// SimulationError.
  bool advance(double t, long& steps_left, const std::function<bool()>& interrupted);
  double time() const { return t_; }
  /// The end of the last step, which may lie beyond time().
  bool anchor_is_due() const;
  long steps() const;
  double step_end() const;
  Eigen::VectorXd at_step_end() const;
  Eigen::Map<const Eigen::VectorXd> y() const;
  Counts counts() const;

  struct Seconds {                // on the clock
    std::vector<double> effects;  ///< as System::effect_names()
    double jacobian = 0, projection = 0, total = 0;
  };
  Seconds seconds() const;

 private:
  static int residual(double t, N_Vector y, N_Vector yp, N_Vector r, void* self);
  static int jacobian(double t, double cj, N_Vector y, N_Vector yp, N_Vector r, SUNMatrix J,
                      void* self, N_Vector, N_Vector, N_Vector);
  static int weights(N_Vector y, N_Vector weights, void* self);
  double first_step(double t, const Eigen::VectorXd& y, const Eigen::VectorXd& yp) const;
  void prepare_matrix();
  int step_past(double t, long& steps_left, const std::function<bool()>& interrupted);
  std::string failure(int flag) const;

  System& system_;
  SmoothOptions options_;
  double t_;
  double tolerance_;  // of a step
  QuietContext context_;
  N_Vector y_ = nullptr, yp_ = nullptr, id_ = nullptr, atol_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver solver_ = nullptr;
  void* ida_ = nullptr;
  std::optional<ida_projection::Projection> projection_;
  Entries entries_;
  std::vector<sunindextype> column_starts_, row_indices_;  // sparse: the pattern
  int multiplier_choices_ = 0;                             // those that KLU's pivots are for

  Stopwatch watch_;
  double jacobian_seconds_ = 0, total_seconds_ = 0;  // wall clock
  long residuals_ = 0, timed_ = 0;
};

}  // namespace tether::scene::smooth
