// Tether: the nonlinear solver that the plugin decorates. SPDX-License-Identifier: BSD-3-Clause
#include "host/corrector.hpp"

#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <utility>

namespace tether::ida_projection {

Corrector::Corrector(SUNNonlinearSolver solver, N_Vector like) : inner_(solver) {
  if (inner_ != nullptr) return;
  own_.reset(SUNNonlinSol_Newton(like, like->sunctx));
  inner_ = own_.get();
}

bool Corrector::is_reached_by(const Ida& ida) {
  const int kept = std::exchange(maximum_iterations_, 0);
  IDASetMaxNonlinIters(ida.mem(), kept);
  return std::exchange(maximum_iterations_, kept) == kept;
}

int Corrector::initialize() {
  iterations_ = failures_in_row_ = 0;
  wait_ = Wait::never;
  judge_apart({});
  return inner_->ops->initialize != nullptr ? SUNNonlinSolInitialize(inner_) : 0;
}

void Corrector::wait(Wait when) {
  if (std::exchange(wait_, when) != when) install_convergence_test();
}

void Corrector::judge_apart(const std::vector<int>& multipliers) {
  multipliers_.set(multipliers);
  install_convergence_test();
}

int Corrector::set_convergence_test(SUNNonlinSolConvTestFn f, void* data) {
  test_ = f;
  test_data_ = data;
  return install_convergence_test();
}

// Installs IDA's own test if nothing has to be added to it.
int Corrector::install_convergence_test() {
  const bool adds = wait_ != Wait::never || multipliers_.acts();
  return adds ? SUNNonlinSolSetConvTestFn(inner_, test_convergence, this)
              : SUNNonlinSolSetConvTestFn(inner_, test_, test_data_);
}

// IDA takes an iteration for divergent if a change is longer than 0.9 of the one before. What
// follows other unknowns changes by the square of their changes (method, section 6). Where its
// first change happens to be small, or wrong, the second one is as long, although the iteration
// converges: it goes on to the third.
int Corrector::test_convergence(SUNNonlinearSolver solver, N_Vector ycor, N_Vector change,
                                sunrealtype tolerance, N_Vector weights, void* self) {
  Corrector& ours = *static_cast<Corrector*>(self);
  const auto flag_of_ida = [&] {
    return ours.test_(solver, ycor, change, tolerance, weights, ours.test_data_);
  };
  int before = 0;
  SUNNonlinSolGetCurIter(solver, &before);
  if (ours.multipliers_.acts())
    return ours.multipliers_.judge(before, ours.maximum_iterations_, change, weights, tolerance,
                                   flag_of_ida);
  const int flag = flag_of_ida();
  const bool waits = ours.wait_ == Wait::always || ours.fails_anyway();
  return waits && flag == SUN_NLS_CONV_RECVR && before == 1 ? SUN_NLS_CONTINUE : flag;
}

int Corrector::residual(N_Vector ycor, N_Vector into) {
  if (stopped()) return stop_flag_;
  const int flag = system_(ycor, into, mem_);
  if (flag < 0) stop(flag, "F, IDA's residual function, returned a negative flag");
  return flag;
}

bool Corrector::solve_linear(N_Vector rhs) {
  const int flag = linear_solve_(rhs, mem_);
  if (flag < 0) stop(flag, "IDA's linear solver failed for good, flag " + std::to_string(flag));
  return flag == 0;
}

void Corrector::stop(int flag, const std::string& text) {
  stop_flag_ = flag;
  stop_text_ = text;
}

}  // namespace tether::ida_projection
