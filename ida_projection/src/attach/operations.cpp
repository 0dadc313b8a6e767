// Tether: the table of operations through which IDA calls the decorator.
// SPDX-License-Identifier: BSD-3-Clause
#include <exception>
#include <new>
#include <sundials/sundials_config.h>

#include "attach/impl.hpp"

namespace tether::ida_projection {

namespace {

Projection::Impl& self(SUNNonlinearSolver solver) {
  return *static_cast<Projection::Impl*>(solver->content);
}

// No exception passes through IDA's C functions. SUNDIALS' solvers are C as well, and what a C++
// residual function throws passes through them to here.
template <class Call>
int shielded(SUNNonlinearSolver solver, Call call) noexcept {
  Projection::Impl& ours = self(solver);
  try {
    return call(ours);
  } catch (const std::bad_alloc&) {
    return ours.caught(Status::out_of_memory, "not enough memory for the projection");
  } catch (const std::exception& e) {
    return ours.caught(Status::callback_fatal, e.what());
  } catch (...) {
    return ours.caught(Status::callback_fatal, "a callback threw what is no std::exception");
  }
}

// The operations that IDA calls on us; the rest goes to the decorated solver.
SUNNonlinearSolver_Type get_type(SUNNonlinearSolver s) {
  return SUNNonlinSolGetType(self(s).corrector().inner());
}
int initialize(SUNNonlinearSolver s) {
  return shielded(s, [](Projection::Impl& ours) { return ours.initialize(); });
}
int setup(SUNNonlinearSolver s, N_Vector y, void* mem) {
  return shielded(s, [&](Projection::Impl& ours) {
    return SUNNonlinSolSetup(ours.corrector().inner(), y, mem);
  });
}
int solve(SUNNonlinearSolver s, N_Vector y0, N_Vector ycor, N_Vector w, sunrealtype tolerance,
#if SUNDIALS_VERSION_MAJOR >= 7
          sunbooleantype call_setup,
#else
          booleantype call_setup,
#endif
          void* mem) {
  return shielded(s, [&](Projection::Impl& ours) {
    return ours.solve(y0, ycor, w, tolerance, call_setup != 0, mem);
  });
}
int set_system(SUNNonlinearSolver s, SUNNonlinSolSysFn f) {
  self(s).corrector().set_system(f);
  return SUNNonlinSolSetSysFn(self(s).corrector().inner(), f);
}
int set_linear_setup(SUNNonlinearSolver s, SUNNonlinSolLSetupFn f) {
  self(s).corrector().set_has_setup(f != nullptr);
  return SUNNonlinSolSetLSetupFn(self(s).corrector().inner(), f);
}
int set_linear_solve(SUNNonlinearSolver s, SUNNonlinSolLSolveFn f) {
  self(s).corrector().set_linear_solve(f);
  return SUNNonlinSolSetLSolveFn(self(s).corrector().inner(), f);
}
int set_convergence_test(SUNNonlinearSolver s, SUNNonlinSolConvTestFn f, void* data) {
  return SUNNonlinSolSetConvTestFn(self(s).corrector().inner(), f, data);
}
int set_maximum_iterations(SUNNonlinearSolver s, int n) {
  self(s).corrector().set_maximum_iterations(n);
  return SUNNonlinSolSetMaxIters(self(s).corrector().inner(), n);
}
int get_iterations(SUNNonlinearSolver s, long* n) {
  const int flag = SUNNonlinSolGetNumIters(self(s).corrector().inner(), n);
  *n += self(s).iterations_after_correction();
  return flag;
}
int get_current_iteration(SUNNonlinearSolver s, int* n) {
  return SUNNonlinSolGetCurIter(self(s).corrector().inner(), n);
}
int get_failures(SUNNonlinearSolver s, long* n) {
  return SUNNonlinSolGetNumConvFails(self(s).corrector().inner(), n);
}
int free_solver(SUNNonlinearSolver) { return 0; }  // the Projection owns it

}  // namespace

SUNNonlinearSolver make_solver(Projection::Impl& implementation, SUNNonlinearSolver inner,
                               SUNContext context) {
  SUNNonlinearSolver solver = SUNNonlinSolNewEmpty(context);
  if (solver == nullptr) return nullptr;
  solver->content = &implementation;
  solver->ops->gettype = get_type;
  solver->ops->initialize = initialize;
  solver->ops->setup = inner->ops->setup != nullptr ? setup : nullptr;
  solver->ops->solve = solve;
  solver->ops->free = free_solver;
  solver->ops->setsysfn = set_system;
  solver->ops->setlsetupfn = set_linear_setup;
  solver->ops->setlsolvefn = set_linear_solve;
  solver->ops->setctestfn = set_convergence_test;
  solver->ops->setmaxiters = set_maximum_iterations;
  solver->ops->getnumiters = get_iterations;
  solver->ops->getcuriter = get_current_iteration;
  solver->ops->getnumconvfails = get_failures;

  return solver;
}

}  // namespace tether::ida_projection
