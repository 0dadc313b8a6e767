// Tether: the table of operations through which IDA calls a decorated nonlinear solver.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <exception>
#include <new>
#include <sundials/sundials_config.h>
#include <sundials/sundials_nonlinearsolver.h>
#include <tether/ida_projection/projection.hpp>

#include "host/corrector.hpp"
#include "host/guarded.hpp"

namespace tether::ida_projection {

/// The nonlinear solver that IDA sees. Its operations call corrector(), initialize(), solve(),
/// iterations_after_correction() and caught() of `Owner`; all others go to the decorated solver.
template <class Owner>
class Operations {
 public:
  static SUNNonlinearSolver make(Owner& owner, SUNNonlinearSolver inner, SUNContext context) {
    SUNNonlinearSolver solver = SUNNonlinSolNewEmpty(context);
    if (solver == nullptr) return nullptr;
    solver->content = &owner;
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

  /// For an owner that ends before IDA, which keeps a pointer to the solver: any further step fails
  /// with a message.
  static void end(SUNNonlinearSolver solver, bool prints) noexcept {
    solver->content = prints ? solver : nullptr;
    *solver->ops = _generic_SUNNonlinearSolver_Ops{};  // SUNDIALS takes what is missing for done
    solver->ops->gettype = [](SUNNonlinearSolver) { return SUNNONLINEARSOLVER_ROOTFIND; };
    solver->ops->initialize = ended;
    solver->ops->solve = [](SUNNonlinearSolver s, N_Vector, N_Vector, N_Vector, sunrealtype,
                            Boolean, void*) { return ended(s); };
  }

 private:
#if SUNDIALS_VERSION_MAJOR >= 7
  using Boolean = sunbooleantype;
#else
  using Boolean = booleantype;
#endif

  static int ended(SUNNonlinearSolver solver) {
    if (solver->content != nullptr)
      std::fprintf(
          stderr,
          "tether: the Projection of this ida_mem has ended, and IDA asks it for a step: "
          "keep it until IDAFree, or attach another nonlinear solver and call IDAReInit\n");
    solver->content = nullptr;
    return kFatal;
  }

  static Owner& self(SUNNonlinearSolver solver) { return *static_cast<Owner*>(solver->content); }

  // No exception passes through IDA's C functions. SUNDIALS' solvers are C as well, and what a C++
  // residual function throws passes through them to here.
  template <class Call>
  static int shielded(SUNNonlinearSolver solver, Call call) noexcept {
    Owner& ours = self(solver);
    try {
      return call(ours);
    } catch (const std::bad_alloc&) {
      return ours.caught(Status::out_of_memory, "not enough memory for the projection");
    } catch (const std::exception& e) {
      return ours.caught(Status::callback_fatal, text_of(e));
    } catch (...) {
      return ours.caught(Status::callback_fatal, "a callback threw what is no std::exception");
    }
  }

  static SUNNonlinearSolver_Type get_type(SUNNonlinearSolver s) {
    return SUNNonlinSolGetType(self(s).corrector().inner());
  }
  static int initialize(SUNNonlinearSolver s) {
    return shielded(s, [](Owner& ours) { return ours.initialize(); });
  }
  static int setup(SUNNonlinearSolver s, N_Vector y, void* mem) {
    return shielded(
        s, [&](Owner& ours) { return SUNNonlinSolSetup(ours.corrector().inner(), y, mem); });
  }
  static int solve(SUNNonlinearSolver s, N_Vector y0, N_Vector ycor, N_Vector w,
                   sunrealtype tolerance, Boolean call_setup, void* mem) {
    return shielded(
        s, [&](Owner& ours) { return ours.solve(y0, ycor, w, tolerance, call_setup != 0, mem); });
  }
  static int set_system(SUNNonlinearSolver s, SUNNonlinSolSysFn f) {
    self(s).corrector().set_system(f);
    return SUNNonlinSolSetSysFn(self(s).corrector().inner(), f);
  }
  static int set_linear_setup(SUNNonlinearSolver s, SUNNonlinSolLSetupFn f) {
    self(s).corrector().set_has_setup(f != nullptr);
    return SUNNonlinSolSetLSetupFn(self(s).corrector().inner(), f);
  }
  static int set_linear_solve(SUNNonlinearSolver s, SUNNonlinSolLSolveFn f) {
    self(s).corrector().set_linear_solve(f);
    return SUNNonlinSolSetLSolveFn(self(s).corrector().inner(), f);
  }
  static int set_convergence_test(SUNNonlinearSolver s, SUNNonlinSolConvTestFn f, void* data) {
    return self(s).corrector().set_convergence_test(f, data);
  }
  static int set_maximum_iterations(SUNNonlinearSolver s, int n) {
    self(s).corrector().set_maximum_iterations(n);
    return SUNNonlinSolSetMaxIters(self(s).corrector().inner(), n);
  }
  static int get_iterations(SUNNonlinearSolver s, long* n) {
    const int flag = SUNNonlinSolGetNumIters(self(s).corrector().inner(), n);
    *n += self(s).iterations_after_correction();
    return flag;
  }
  static int get_current_iteration(SUNNonlinearSolver s, int* n) {
    return SUNNonlinSolGetCurIter(self(s).corrector().inner(), n);
  }
  static int get_failures(SUNNonlinearSolver s, long* n) {
    return SUNNonlinSolGetNumConvFails(self(s).corrector().inner(), n);
  }
  static int free_solver(SUNNonlinearSolver) { return 0; }  // the Projection owns it
};

}  // namespace tether::ida_projection
