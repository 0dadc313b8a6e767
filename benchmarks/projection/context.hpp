// Tether: what every host of a SUNDIALS integrator needs here. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>

#include <algorithm>
#include <ctime>
#include <problems/problem.hpp>
#include <vector>

namespace tether::bench {

/// A context without MPI.
inline SUNContext make_context() {
  SUNContext context = nullptr;
#ifdef SUN_COMM_NULL  // SUNDIALS 7
  SUNContext_Create(SUN_COMM_NULL, &context);
  SUNContext_ClearErrHandlers(context);  // a failed run is a row of a table, not a message
#else
  SUNContext_Create(nullptr, &context);
#endif
  return context;
}

/// SUNDIALS 6's error handler for the same purpose.
[[maybe_unused]] inline void silent(int, const char*, const char*, char*, void*) {}

inline N_Vector vector_of(const std::vector<double>& values, SUNContext context) {
  N_Vector v = N_VNew_Serial(static_cast<sunindextype>(values.size()), context);
  std::copy(values.begin(), values.end(), N_VGetArrayPointer(v));
  return v;
}

/// tolerance times the problem's scales.
inline std::vector<double> absolute_tolerances(const problems::Problem& problem, double tolerance) {
  std::vector<double> atol(static_cast<std::size_t>(problem.size), tolerance);
  for (std::size_t i = 0; i < problem.atol_scale.size(); ++i) atol[i] *= problem.atol_scale[i];
  return atol;
}

/// Process CPU time in s.
inline double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The CPU limit of a run. Reading the clock costs as much as a small F, so only every 1024th call
/// does; large problems, whose F is dear, at every call.
class Deadline {
 public:
  Deadline(double seconds, int unknowns)
      : end_(cpu_seconds() + seconds), every_(unknowns > 100 ? 1 : 1024) {}
  bool passed() {
    if (++calls_ % every_ == 0 && cpu_seconds() > end_) late_ = true;
    return late_;
  }
  bool late() const { return late_; }
  long calls() const { return calls_; }

 private:
  double end_;
  long every_, calls_ = 0;
  bool late_ = false;
};

}  // namespace tether::bench
