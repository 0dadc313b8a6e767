// Tether: IDA's memory through its public getters. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ida/ida.h>

namespace tether::ida_projection {

/// Values of IDA's public getters inside a solve.
struct StepData {
  double t = 0.0, cj = 0.0;
  N_Vector y_predicted = nullptr, yp_predicted = nullptr;
  N_Vector residual = nullptr;  ///< F as it was evaluated last
  N_Vector y = nullptr;  ///< as F was evaluated last or, after the corrector, as it is accepted
};

/// IDA's counts and the step that it tries.
struct IntegratorData {
  double t = 0.0, cj = 0.0;
  long steps = 0;  ///< accepted
  long error_test_failures = 0;
  double h = 0.0;
  int order = 1;
};

/// The host's ida_mem, not owned.
class Ida {
 public:
  explicit Ida(void* mem) : mem_(mem) {}

  void* mem() const { return mem_; }
  long steps() const { return count(IDAGetNumSteps); }
  long setups() const { return count(IDAGetNumLinSolvSetups); }
  /// Evaluations of F for one Jacobian by differences; 0 where the caller gives it, or none is
  /// made.
  long evaluations_for_jacobian() const {
    const long jacobians = count(IDAGetNumJacEvals);
    return jacobians > 0 ? count(IDAGetNumLinResEvals) / jacobians : 0;
  }
  double step_size() const {
    sunrealtype h = 0.0;
    IDAGetCurrentStep(mem_, &h);
    return h;
  }
  IntegratorData integrator() const {
    IntegratorData data;
    IDAGetCurrentTime(mem_, &data.t);
    IDAGetCurrentCj(mem_, &data.cj);
    IDAGetNumSteps(mem_, &data.steps);
    IDAGetNumErrTestFails(mem_, &data.error_test_failures);
    IDAGetCurrentStep(mem_, &data.h);
    IDAGetCurrentOrder(mem_, &data.order);
    return data;
  }
  StepData step() const {
    StepData step;
    N_Vector ypn;
    void* user_data;
    sunrealtype t = 0.0, cj = 0.0;
    IDAGetNonlinearSystemData(mem_, &t, &step.y_predicted, &step.yp_predicted, &step.y, &ypn,
                              &step.residual, &cj, &user_data);
    step.t = t;
    step.cj = cj;
    return step;
  }

 private:
  long count(int (*get)(void*, long*)) const {
    long n = 0;
    get(mem_, &n);
    return n;
  }

  void* mem_;
};

}  // namespace tether::ida_projection
