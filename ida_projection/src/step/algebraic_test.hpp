// Tether: IDA's error test of algebraic variables (method, section 6). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "host/candidate.hpp"

namespace tether::ida_projection {

/// IDA's error test of the algebraic variables of index 1 that differential ones depend on: their
/// tolerance is widened by what moves do to them; see algebraic_test.cpp.
class AlgebraicTest {
 public:
  void begin(const std::vector<int>& variables);
  bool acts() const { return !variables_.empty(); }
  /// A new attempt, `steps` accepted before it: its order and step size, and the length of its
  /// move.
  void begin_attempt(const Candidate& candidate, double move, int order, double h, long steps);
  /// Whether these variables keep IDA from doubling its step.
  bool limit_step() const;
  /// In the first step: whether their error has stayed although IDA has shortened the step.
  bool stay() const;
  /// Lowers the weights. `response`: change of y by which F responds to the move; null: not known.
  void widen(const Candidate& candidate, const double* response);
  /// The weights before widen(): IDA computes them anew for a new step only.
  void restore(N_Vector weights, long steps) const;

 private:
  struct Variable {
    int index;
    double weight;    // IDA's, of the last attempt's step
    double response;  // to a move by one tolerance, largest of the latest steps
  };
  double widened(const Variable& v, double weight, double y) const;
  void detect_jump(double h, long steps);

  std::vector<Variable> variables_;
  // The last attempt:
  long steps_ = -1;
  int order_ = 1;
  double move_ = 0.0, noise_ = 0.0;
  double error_ = 0.0, first_error_ = 0.0;  // as IDA's test sees them; of the first attempt
  double h_ = 0.0;
  // The first refused step since many in a row were accepted, and its error; 0: none was.
  double refused_h_ = 0.0, refused_error_ = 0.0;
  int accepted_ = 0;   // in a row
  bool jump_ = false;  // the error stays in steps that are far shorter
};

}  // namespace tether::ida_projection
