// Tether: IDA's error test of algebraic variables (method, section 6). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "host/candidate.hpp"
#include "step/attempt.hpp"

namespace tether::ida_projection {

class Polish;

/// IDA's error test of the algebraic variables of index 1 that differential ones depend on: their
/// tolerance is widened by what moves do to them; see algebraic_test.cpp.
class AlgebraicTest {
 public:
  void begin(const std::vector<int>& variables);
  bool acts() const { return !variables_.empty(); }
  /// Lowers the weights in an attempt that will be handed over, after a move of this length.
  /// `solved`: variables that rows are solved for, ascending, which keep their tolerances. The
  /// response of F to the move is asked of its polish where these variables keep IDA from doubling
  /// its step.
  void widen(const Attempt& attempt, const Candidate& candidate, double move,
             const std::vector<int>& solved, Polish& polish, const Ida& ida);
  /// In the first step: whether their error has stayed although IDA has shortened the step.
  bool stay() const;
  /// The weights before widen(), in another attempt at the same step: IDA computes them anew for a
  /// new step only.
  void restore(N_Vector weights) const;

 private:
  struct Variable {
    int index;
    double weight = 0.0;    // IDA's, of the last attempt's step
    double response = 0.0;  // to a move by one tolerance, largest of the latest steps
  };
  double widened(const Variable& v, double y) const;
  void detect_jump(const Attempt& attempt);

  // The first attempt, the last one, and the first refused one since many in a row were accepted.
  // Errors are as IDA's test sees them; h = 0: there was none.
  struct Tested {
    double h = 0.0, error = 0.0;
  };
  std::vector<Variable> variables_;
  Tested first_, last_, refused_;
  int order_ = 0;
  double move_ = 0.0;
  double noise_ = 0.0;    // at this order: multiple of independent errors
  double doubled_ = 0.0;  // the largest error with which IDA doubles h: twice it is 2^-(k+1)
  int accepted_ = 0;      // in a row
  bool jump_ = false;     // the error stays in steps that are far shorter
};

}  // namespace tether::ida_projection
