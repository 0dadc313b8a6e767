// Tether: the kind of IDA's linear solver. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "host/ida.hpp"

namespace tether::ida_projection {

/// Finds out whether IDA's linear solver is iterative, for which there is no getter. Only iterative
/// solvers count iterations, from the first nonzero right-hand side on.
class LinearSolverKind {
 public:
  /// After a correction; `steps`: accepted before it.
  void find(const Ida& ida, long steps) {
    long iterations = 0, preconditioners = 0, jacobians = 0;
    IDAGetNumLinIters(ida.mem(), &iterations);
    IDAGetNumPrecEvals(ida.mem(), &preconditioners);
    IDAGetNumJacEvals(ida.mem(), &jacobians);
    iterative_ = iterations > 0 || preconditioners > 0;
    known_ = iterative_ || (jacobians > 0 && steps > 0);
  }
  bool known() const { return known_; }
  bool iterative() const { return iterative_; }

 private:
  bool known_ = false, iterative_ = false;
};

}  // namespace tether::ida_projection
