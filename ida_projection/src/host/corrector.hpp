// Tether: the nonlinear solver that the plugin decorates (method, section 2).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/linalg/vector_code.hpp>
#include <type_traits>
#include <vector>

#include "host/candidate.hpp"
#include "host/ida.hpp"
#include "host/multiplier_test.hpp"
#include "host/owned_vector.hpp"

namespace tether::ida_projection {

/// The decorated solver with the functions that IDA gives to it (residual, linear solver), which
/// the plugin calls as well. A negative flag of any of them is kept and ends the run.
class Corrector {
 public:
  /// `solver`: the caller's; null: SUNDIALS' Newton iteration, made here. inner() is null where
  /// that fails.
  Corrector(SUNNonlinearSolver solver, N_Vector like);

  SUNNonlinearSolver inner() const { return inner_; }
  void set_system(SUNNonlinSolSysFn f) { system_ = f; }
  void set_linear_solve(SUNNonlinSolLSolveFn f) { linear_solve_ = f; }
  void set_has_setup(bool has) { has_setup_ = has; }
  int set_convergence_test(SUNNonlinSolConvTestFn f, void* data);
  void set_maximum_iterations(int n) { maximum_iterations_ = n; }
  int maximum_iterations() const { return maximum_iterations_; }
  /// Whether IDASetMaxNonlinIters arrives at this solver.
  bool is_reached_by(const Ida& ida);

  int initialize();  ///< a new run starts
  /// A new attempt; `mem`: IDA's memory in it.
  void begin(void* mem) {
    mem_ = mem;
    stop_flag_ = 0;
  }
  /// Computes the correction of the candidate.
  int correct(const Candidate& candidate, double tolerance, bool call_setup) {
    multipliers_.begin(candidate.h, has_setup_ ? candidate.cj : 0.0, call_setup);
    const int flag = SUNNonlinSolSolve(inner_, candidate.base, candidate.correction,
                                       candidate.weights, tolerance, call_setup, mem_);
    SUNNonlinSolGetNumIters(inner_, &iterations_);
    failures_in_row_ = flag == 0 ? 0 : failures_in_row_ + 1;
    return flag;
  }
  /// Whether corrections fail although IDA has cut the step for that.
  bool fails_anyway() const { return failures_in_row_ >= kFailsAnyway; }
  /// These multipliers are judged apart from IDA's convergence test in this run.
  void judge_apart(const std::vector<int>& multipliers);
  MultiplierTest& multipliers() { return multipliers_; }
  /// When IDA's test does not fail at the second change: where algebraic variables follow others,
  /// or where corrections fail although IDA has cut the step.
  enum class Wait { never, after_failures, always };
  void wait(Wait when);
  /// F(t, ypred + ycor, yppred + cj ycor) through IDA's own callback; 0, or > 0: it cannot be
  /// evaluated. Once it asked for the end of the run it is not called again.
  int residual(N_Vector ycor, N_Vector into);
  /// The same with base(j) in place of each entry ypred_j, which is put back bit for bit: F
  /// elsewhere than at the candidate, of contiguous vectors.
  template <class Base>
  int residual_with(const Candidate& candidate, Base base, N_Vector ycor, N_Vector into) {
    const auto n = static_cast<std::size_t>(N_VGetLength(candidate.base));
    if (kept_.size() < n) kept_.resize(n);
    double* const predicted = candidate.base_entries;
    double* const kept = kept_.data();
    TETHER_ELEMENTWISE
    for (std::size_t j = 0; j < n; ++j) {
      kept[j] = predicted[j];
      predicted[j] = base(j);
    }
    const int flag = residual(ycor, into);
    TETHER_ELEMENTWISE
    for (std::size_t j = 0; j < n; ++j) predicted[j] = kept[j];
    return flag;
  }
  bool solve_linear(N_Vector rhs);
  long iterations() const { return iterations_; }  ///< of the last correction
  int failures_in_row() const { return failures_in_row_; }

  bool has_setup() const { return has_setup_; }
  bool solves() const { return linear_solve_ != nullptr; }

  void stop(int flag, const std::string& text);
  bool stopped() const { return stop_flag_ < 0; }
  int stop_flag() const { return stop_flag_; }
  const std::string& stop_text() const { return stop_text_; }
  void forget_stop() { stop_flag_ = 0; }

 private:
  static constexpr int kFailsAnyway = 2;  // failures in a row, between which IDA has cut the step

  Owned<SUNNonlinearSolver, SUNNonlinSolFree> own_;
  SUNNonlinearSolver inner_ = nullptr;
  SUNNonlinSolSysFn system_ = nullptr;
  SUNNonlinSolLSolveFn linear_solve_ = nullptr;
  bool has_setup_ =
      false;  // IDA's linear solver has factors, or a preconditioner, that can be renewed
  int maximum_iterations_ = 4;
  void* mem_ = nullptr;
  int stop_flag_ = 0;  // < 0: a callback ended the run in an evaluation of the plugin's own
  std::string stop_text_;
  std::vector<double> kept_;  // entries of ypred
  static int test_convergence(SUNNonlinearSolver solver, N_Vector ycor, N_Vector change,
                              sunrealtype tolerance, N_Vector weights, void* self);
  int install_convergence_test();

  SUNNonlinSolConvTestFn test_ = nullptr;  // IDA's
  void* test_data_ = nullptr;
  Wait wait_ = Wait::never;
  long iterations_ = 0;
  int failures_in_row_ = 0;
  MultiplierTest multipliers_;
};

}  // namespace tether::ida_projection
