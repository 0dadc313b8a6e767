// Tether: IDA's error test of algebraic variables. SPDX-License-Identifier: BSD-3-Clause
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
  /// Would they alone keep IDA from a step of twice the size after a move of this length?
  bool limits_step(const Candidate& candidate, double move, int order) const;
  /// Lowers the weights of an attempt at the given order. `steps`: accepted before it; `response`:
  /// change of y by which F answers to the move (null: not asked).
  void widen(const Candidate& candidate, const double* response, double move, int order,
             long steps);
  /// The weights before widen(): IDA computes them anew for a new step only.
  void restore(N_Vector weights, long steps) const;

 private:
  struct Variable {
    int index;
    double weight;    // IDA's, of the last attempt's step
    double response;  // to a move by one tolerance, largest of the latest steps
  };
  static double widened(const Candidate& candidate, const Variable& v, double move, int order);

  std::vector<Variable> variables_;
  long steps_ = -1;  // those of the last attempt
};

}  // namespace tether::ida_projection
