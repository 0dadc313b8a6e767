// Tether: RADAU5 and DASPK out of the R package deSolve. SPDX-License-Identifier: BSD-3-Clause
//
// The package's shared object holds the Fortran routines; it is opened at run time (R itself is not
// started) and is nothing that Tether is built with. What it wants from R is printing: the few
// functions below take that place because the program's own symbols are found first.
#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "code.hpp"
#include "explicit_form.hpp"

extern "C" {
void Rprintf(const char*, ...) {}
void Rf_warning(const char*, ...) {}
void intpr_(const char*, int*, int*, int*, int) {}
void dblepr_(const char*, int*, double*, int*, int) {}
}

namespace tether::bench {

namespace {

// Fortran callbacks carry no pointer of the caller's.
struct Host {
  const problems::Problem* problem;
  const ExplicitForm* form;
  const Watch* watch;
  Deadline deadline;
};
Host* host = nullptr;

extern "C" {
using RadauRates = void (*)(int*, double*, double*, double*, double*, int*);
using RadauJacobian = void (*)(int*, double*, double*, double*, int*, double*, int*);
using RadauMass = void (*)(int*, double*, int*, double*, int*);
using RadauOutput = void (*)(int*, double*, double*, double*, double*, int*, int*, double*, int*,
                             int*);
using Radau5 = void (*)(int* n, RadauRates, double* x, double* y, double* x_end, double* h,
                        double* rtol, double* atol, int* itol, RadauJacobian, int* ijac, int* mljac,
                        int* mujac, RadauMass, int* imas, int* mlmas, int* mumas, RadauOutput,
                        int* iout, double* work, int* lwork, int* iwork, int* liwork, double* rpar,
                        int* ipar, int* idid);
using DaspkResidual = void (*)(double*, double*, double*, double*, double*, int*, double*, int*);
using Ddaspk = void (*)(DaspkResidual, int* n, double* t, double* y, double* yp, double* tout,
                        int* info, double* rtol, double* atol, int* idid, double* rwork, int* lrw,
                        int* iwork, int* liw, double* rpar, int* ipar, void* jac, void* psol);

void radau_rates(int* n, double* t, double* y, double* f, double*, int*) {
  if (host->deadline.passed()) {  // RADAU5 has no way out but a step size that becomes too small
    std::fill(f, f + *n, std::nan(""));
    return;
  }
  host->form->evaluate(*t, y, f, false);
}
void radau_jacobian(int*, double*, double*, double*, int*, double*, int*) {}
void radau_mass(int* n, double* mass, int*, double*, int*) {
  std::copy(host->form->mass().begin(), host->form->mass().begin() + *n * *n, mass);
}
void radau_output(int* number, double*, double* t, double* y, double*, int*, int*, double*, int*,
                  int* stop) {
  *stop = 0;
  if (*number > 1) (*host->watch)(*t, y, 5);
}
void daspk_residual(double* t, double* y, double* yp, double*, double* r, int* ires, double*,
                    int*) {
  if (host->deadline.passed()) {
    *ires = -2;
    return;
  }
  host->problem->residual(*t, y, yp, r);
}
}

class Library {
 public:
  static const Library& get() {
    static const Library library;
    return library;
  }
  Radau5 radau5 = nullptr;
  Ddaspk ddaspk = nullptr;

  std::string missing() const {
    return radau5 && ddaspk ? std::string()
                            : "needs deSolve.so (apt-get install r-cran-desolve), or its path in "
                              "TETHER_DESOLVE";
  }

 private:
  Library() {
    const char* named = std::getenv("TETHER_DESOLVE");
    // A name that is given is the only place: it can also hide the package.
    if (named) {
      open(named);
      return;
    }
    for (const char* place : {"/usr/lib/R/site-library/deSolve/libs/deSolve.so",
                              "/usr/local/lib/R/site-library/deSolve/libs/deSolve.so",
                              "/usr/lib/R/library/deSolve/libs/deSolve.so"})
      if (!ddaspk) open(place);
  }

  void open(const char* place) {
    void* handle = dlopen(place, RTLD_LAZY | RTLD_LOCAL);  // stays open to the end
    if (!handle) return;
    radau5 = reinterpret_cast<Radau5>(dlsym(handle, "radau5_"));
    ddaspk = reinterpret_cast<Ddaspk>(dlsym(handle, "ddaspk_"));
  }
};

void finish(const problems::Problem& problem, const Host& its, double begin, Run& run) {
  run.cpu_ms = 1e3 * (cpu_seconds() - begin);
  run.error = problem.error(run.y.data());
  run.residuals = its.deadline.calls();
  if (run.failed)
    run.message = its.deadline.late() ? "time limit" : "return code " + std::to_string(run.flag);
}

class Radau5Code : public Code {
 public:
  std::string name() const override { return "RADAU5"; }
  std::string version() const override { return "of r-cran-desolve"; }
  std::string missing() const override { return Library::get().missing(); }
  std::string refuses(const problems::Problem& problem) const override {
    if (!dense_enough(problem)) return kOnlyDense;
    return ExplicitForm(problem).constant() ? std::string() : "dF/dy' is not constant";
  }

  Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
          const Watch& watch) const override {
    const ExplicitForm form(problem);
    int n = problem.size, itol = 1, no = 0, imas = 1, iout = watch ? 1 : 0, idid = 0, ipar = 0;
    int lwork = n * (5 * n + 12) + 20, liwork = 3 * n + 20,
        limit_steps = static_cast<int>(limits.steps);
    std::vector<double> work(static_cast<std::size_t>(lwork), 0.0);
    std::vector<int> iwork(static_cast<std::size_t>(liwork), 0);
    std::vector<double> atol = absolute_tolerances(problem, tolerance),
                        rtol(atol.size(), tolerance);
    iwork[1] = limit_steps;
    for (std::size_t k = 0; k < 3 && !problem.variable_index.empty(); ++k)
      iwork[4 + k] = static_cast<int>(std::count(
          problem.variable_index.begin(), problem.variable_index.end(), static_cast<int>(k) + 1));
    double t = problem.t0, t_end = problem.t_end, rpar = 0.0;
    double h = problem.initial_step > 0.0 ? problem.initial_step : 1e-6 * (t_end - t);
    Host its{&problem, &form, &watch, Deadline(limits.cpu_seconds, n)};
    host = &its;
    Run run;
    run.y = problem.y0;
    const double begin = cpu_seconds();
    Library::get().radau5(&n, radau_rates, &t, run.y.data(), &t_end, &h, rtol.data(), atol.data(),
                          &itol, radau_jacobian, &no, &n, &n, radau_mass, &imas, &n, &n,
                          radau_output, &iout, work.data(), &lwork, iwork.data(), &liwork, &rpar,
                          &ipar, &idid);
    host = nullptr;
    run.flag = idid;
    run.failed = idid < 1;
    run.jacobians = iwork[14];
    run.steps = iwork[16];
    run.error_failures = iwork[17];
    run.factorizations = iwork[18];
    finish(problem, its, begin, run);
    return run;
  }
};

class DaspkCode : public Code {
 public:
  explicit DaspkCode(bool suppressed) : suppressed_(suppressed) {}
  std::string name() const override { return suppressed_ ? "DASPK suppressed" : "DASPK"; }
  std::string version() const override { return "of r-cran-desolve"; }
  std::string missing() const override { return Library::get().missing(); }
  std::string refuses(const problems::Problem& problem) const override {
    if (!dense_enough(problem)) return kOnlyDense;
    if (problem.index > 2) return "DASPK is made for index 0, 1 and, with care, 2";
    const bool algebraic = std::count(problem.id.begin(), problem.id.end(), 0.0) > 0;
    return suppressed_ && !algebraic ? "no algebraic variables" : std::string();
  }

  Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
          const Watch& watch) const override {
    int n = problem.size, idid = 0, ipar = 0, info[30] = {};
    const auto N = static_cast<std::size_t>(n);
    int lrw = 60 + 12 * n + n * n, liw = 60 + 3 * n;
    std::vector<double> rwork(static_cast<std::size_t>(lrw), 0.0);
    std::vector<int> iwork(static_cast<std::size_t>(liw), 0);
    std::vector<double> atol = absolute_tolerances(problem, tolerance), rtol(N, tolerance);
    info[1] = 1;  // a tolerance for each component
    info[2] = watch ? 1 : 0;
    info[3] = 1;  // not past t_end
    rwork[0] = problem.t_end;
    if (problem.initial_step > 0.0) {
      info[7] = 1;
      rwork[2] = problem.initial_step;
    }
    if (suppressed_) {
      info[15] = 1;
      for (std::size_t i = 0; i < N; ++i) iwork[40 + i] = problem.id[i] == 1.0 ? 1 : -1;
    }
    Host its{&problem, nullptr, &watch, Deadline(limits.cpu_seconds, n)};
    host = &its;
    Run run;
    run.y = problem.y0;
    std::vector<double> yp = problem.yp0;
    double t = problem.t0, t_end = problem.t_end, rpar = 0.0;
    const double begin = cpu_seconds();
    do {
      Library::get().ddaspk(daspk_residual, &n, &t, run.y.data(), yp.data(), &t_end, info,
                            rtol.data(), atol.data(), &idid, rwork.data(), &lrw, iwork.data(), &liw,
                            &rpar, &ipar, nullptr, nullptr);
      if (watch && idid > 0) watch(t, run.y.data(), iwork[7]);
      info[0] = 1;
      // -1: 500 steps, after which DASPK asks whether to go on.
    } while ((idid == -1 || (idid == 1 && watch)) && iwork[10] < limits.steps);
    host = nullptr;
    run.flag = idid;
    run.failed = idid < 1;
    run.steps = iwork[10];
    run.jacobians = run.factorizations = iwork[12];
    run.error_failures = iwork[13];
    run.solver_failures = iwork[14];
    finish(problem, its, begin, run);
    return run;
  }

 private:
  bool suppressed_;
};

}  // namespace

void add_desolve_codes(Codes& codes) {
  codes.push_back(std::make_unique<Radau5Code>());
  codes.push_back(std::make_unique<DaspkCode>(false));
  codes.push_back(std::make_unique<DaspkCode>(true));
}

}  // namespace tether::bench
