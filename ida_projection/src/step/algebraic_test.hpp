// Tether: IDA's error test of algebraic variables (method, section 6). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "host/candidate.hpp"
#include "step/attempt.hpp"

namespace tether::ida_projection {

/// IDA's error test of the algebraic variables of index 1 that differential ones depend on: their
/// tolerance is widened by what moves do to them; see algebraic_test.cpp.
class AlgebraicTest {
 public:
  void begin(const std::vector<int>& variables);
  bool acts() const { return !variables_.empty(); }
  /// In the first step: whether their error has stayed although IDA has shortened the step.
  bool stay() const;
  /// Lowers the weights of an attempt that will be handed over, after a move of this length.
  /// `response`: change of y by which F has responded to the move; null: not measured. `solved`:
  /// variables that rows are solved for, ascending: they do not respond.
  void widen(const Attempt& attempt, const Candidate& candidate, double move,
             const double* response, const std::vector<int>& solved);
  /// Length of the response to a move by one tolerance, in tolerances; infinity: it was not
  /// measured in the latest steps; 0: no variable is tested.
  double response_length(const Candidate& candidate) const;
  /// The weights before widen(), in another attempt at the same step: IDA computes them anew for a
  /// new step only.
  void restore(N_Vector weights) const;

 private:
  struct Variable {
    int index;
    double weight = 0.0;    // IDA's, of the last attempt's step
    double response = 0.0;  // to a move by one tolerance, largest of the latest steps
    double moved = 0.0;     // by moves of the latest accepted steps, the largest
  };
  void note_response(const Candidate& candidate, double move, const double* response);
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
  double noise_ = 0.0;  // at this order: multiple of independent errors
  int measured_ = 0;    // steps since the response was; it counts for kMeasured of them
  int accepted_ = 0;    // in a row
  bool jump_ = false;   // the error stays in steps that are far shorter
};

}  // namespace tether::ida_projection
