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
    using Solver = SUNNonlinearSolver;
    solver->content = &owner;
    const SUNNonlinearSolver_Ops ops = solver->ops;
    ops->gettype = [](Solver s) { return SUNNonlinSolGetType(inner_of(s)); };
    ops->initialize = [](Solver s) {
      return shielded(s, [](Owner& ours) { return ours.initialize(); });
    };
    if (inner->ops->setup != nullptr)
      ops->setup = [](Solver s, N_Vector y, void* mem) {
        return shielded(s, [&](Owner&) { return SUNNonlinSolSetup(inner_of(s), y, mem); });
      };
    ops->solve = [](Solver s, N_Vector y0, N_Vector ycor, N_Vector w, sunrealtype tolerance,
                    Boolean call_setup, void* mem) {
      return shielded(
          s, [&](Owner& ours) { return ours.solve(y0, ycor, w, tolerance, call_setup != 0, mem); });
    };
    ops->free = [](Solver) { return 0; };  // the Projection owns it
    ops->setsysfn = [](Solver s, SUNNonlinSolSysFn f) {
      self(s).corrector().set_system(f);
      return SUNNonlinSolSetSysFn(inner_of(s), f);
    };
    ops->setlsetupfn = [](Solver s, SUNNonlinSolLSetupFn f) {
      self(s).corrector().set_has_setup(f != nullptr);
      return SUNNonlinSolSetLSetupFn(inner_of(s), f);
    };
    ops->setlsolvefn = [](Solver s, SUNNonlinSolLSolveFn f) {
      self(s).corrector().set_linear_solve(f);
      return SUNNonlinSolSetLSolveFn(inner_of(s), f);
    };
    ops->setctestfn = [](Solver s, SUNNonlinSolConvTestFn f, void* data) {
      return self(s).corrector().set_convergence_test(f, data);
    };
    ops->setmaxiters = [](Solver s, int n) {
      self(s).corrector().set_maximum_iterations(n);
      return SUNNonlinSolSetMaxIters(inner_of(s), n);
    };
    ops->getnumiters = [](Solver s, long* n) {
      *n = self(s).corrector().iterations() + self(s).iterations_after_correction();
      return 0;
    };
    ops->getcuriter = [](Solver s, int* n) { return SUNNonlinSolGetCurIter(inner_of(s), n); };
    ops->getnumconvfails = [](Solver s, long* n) {
      return SUNNonlinSolGetNumConvFails(inner_of(s), n);
    };
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
  static SUNNonlinearSolver inner_of(SUNNonlinearSolver s) { return self(s).corrector().inner(); }

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
};

}  // namespace tether::ida_projection
