// Tether: Newton's convergence test of multipliers (method, section 6). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <sundials/sundials_nvector.h>
#include <utility>
#include <vector>

namespace tether::ida_projection {

/// IDA's convergence test sees the other variables, and multipliers of index 2 or more are judged
/// beside it; see multiplier_test.cpp. Contiguous vectors.
class MultiplierTest {
 public:
  /// None (empty): IDA's test sees all variables.
  void set(const std::vector<int>& multipliers);
  bool acts() const { return !multipliers_.empty(); }
  /// A correction begins, of a step of size h, with new factors if `setup`. `cj`: 0 if the linear
  /// solver keeps no factors, which could be those of another cj.
  void begin(double h, double cj, bool setup) {
    h_ = h;
    firsts_ = setup || cj != std::exchange(cj_, cj) ? 1 : 0;
  }
  /// Judges a change of y in the iteration, after `before` others of at most `most`: a flag of
  /// SUNNonlinearSolver. `others`: gives IDA's; the weights of multipliers are 0 in its call.
  template <class Others>
  int judge(int before, int most, N_Vector change, N_Vector weights, double tolerance,
            Others others) {
    hide(weights);
    const int flag = others();
    show(weights);
    const int judgement = judged(before, flag, length(change, weights), tolerance);
    return most > 1 ? judgement : flag;  // else there is no rate
  }
  /// Length in tolerances of these entries.
  double length(N_Vector v, N_Vector weights) const;
  /// Until the next call changes of this length at the present h are taken for rounding, shorter
  /// ones at larger h.
  void allow(double rounding);

 private:
  int judged(int before, int flag, double length, double tolerance);
  void hide(N_Vector weights);
  void show(N_Vector weights) const;

  std::vector<int> multipliers_;
  std::vector<double> hidden_;  // their weights
  double last_ = 0.0;           // length of the last change
  double h_ = 0.0, cj_ = 0.0;
  double rounding_ = 0.0;  // length of a change by rounding times h
  double share_ = 1.0;     // of a first change that is left, by the last rate with this cj
  int firsts_ = 0;  // first changes with this cj and these factors; a repeated one has new factors
  bool others_converged_ = false;  // in this correction
};

}  // namespace tether::ida_projection
