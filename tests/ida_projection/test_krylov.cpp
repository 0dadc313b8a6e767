// Tether: hosts whose linear solver is iterative. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_spbcgs.h>
#include <sunlinsol/sunlinsol_spfgmr.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunlinsol/sunlinsol_sptfqmr.h>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

constexpr double kEnd = 0.1;

/// u' = -(f_{i+1/2} - f_{i-1/2}) / dx, f_{i+1/2} = (u_i^2 + u_i u_{i+1} + u_{i+1}^2) / 6, periodic
/// on (0, 1): keeps sum u and sum u^2.
int burgers(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void*) {
  const auto n = N_VGetLength(y);
  const double *u = N_VGetArrayPointer(y), *du = N_VGetArrayPointer(yp);
  double* f = N_VGetArrayPointer(r);
  for (sunindextype i = 0; i < n; ++i) {
    const double left = u[(i + n - 1) % n], here = u[i], right = u[(i + 1) % n];
    const double out = (here * here + here * right + right * right) / 6.0;
    const double in = (left * left + left * here + here * here) / 6.0;
    f[i] = du[i] + (out - in) * static_cast<double>(n);
  }
  return 0;
}

tp::Constraints kept(N_Vector start, bool energy) {
  const auto sums = [energy](N_Vector y, double* g) {
    g[0] = g[1] = 0.0;
    for (sunindextype i = 0; i < N_VGetLength(y); ++i) {
      const double u = N_VGetArrayPointer(y)[i];
      g[0] += u;
      g[1] += u * u / 2.0;
    }
    return energy ? 2 : 1;
  };
  double at_start[2];
  sums(start, at_start);
  tp::Constraints set;
  set.count = energy ? 2 : 1;
  set.jacobian = tp::Gradients{[=](double, N_Vector y, double* g) {
                                 double now[2];
                                 const int rows = sums(y, now);
                                 for (int i = 0; i < rows; ++i) g[i] = now[i] - at_start[i];
                               },
                               [energy](double, N_Vector y, N_Vector* rows) {
                                 N_VConst(1.0, rows[0]);
                                 if (energy) N_VScale(1.0, y, rows[1]);
                               }};
  return set;
}

using Make = SUNLinearSolver (*)(N_Vector, SUNContext);

struct End {
  int flag = 0;
  long steps = 0;
  std::vector<double> y;
  std::string message;
};

/// rows: 0 plain IDA, 1 mass, 2 mass and energy.
End run(int n, double tolerance, int rows, Make make) {
  Context context;
  N_Vector y = N_VNew_Serial(n, context), yp = N_VNew_Serial(n, context);
  for (int i = 0; i < n; ++i)
    N_VGetArrayPointer(y)[i] = 1.5 + std::sin(2.0 * 3.14159265358979 * (i + 0.5) / n);
  N_VConst(0.0, yp);
  N_Vector f = N_VClone(y);
  burgers(0.0, y, yp, f, nullptr);
  N_VScale(-1.0, f, yp);
  void* ida = IDACreate(context);
  IDAInit(ida, burgers, 0.0, y, yp);
  IDASStolerances(ida, tolerance, tolerance);
  IDASetMaxNumSteps(ida, 20000);
  SUNLinearSolver solver = make(y, context);
  IDASetLinearSolver(ida, solver, nullptr);
  End end;
  {
    std::unique_ptr<tp::Projection> projection;
    tp::Options options;
    options.print_fatal = options.print_warnings = false;
    if (rows > 0) projection = std::make_unique<tp::Projection>(ida, kept(y, rows == 2), options);
    sunrealtype t = 0.0;
    while (t < kEnd && end.flag >= 0) end.flag = IDASolve(ida, kEnd, &t, y, yp, IDA_ONE_STEP);
    if (end.flag >= 0) IDAGetDky(ida, kEnd, 0, y);
    IDAGetNumSteps(ida, &end.steps);
    if (projection) end.message = projection->message();
    end.y.assign(N_VGetArrayPointer(y), N_VGetArrayPointer(y) + n);
    IDAFree(&ida);
  }
  SUNLinSolFree(solver);
  for (N_Vector v : {y, yp, f}) N_VDestroy(v);
  return end;
}

double distance(const End& a, const End& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.y.size(); ++i)
    largest = std::max(largest, std::abs(a.y[i] - b.y[i]));
  return largest;
}

const Make spgmr = [](N_Vector y, SUNContext c) {
  return SUNLinSol_SPGMR(y, SUN_PREC_NONE, 10, c);
};

}  // namespace

TEST_CASE(
    "Burgers' equation, mass and energy kept: GMRES runs wherever plain IDA does, near its steps") {
  for (const int n : {100, 400}) {
    const End exact = run(n, 1e-11, 0, spgmr);
    for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6, 1e-7}) {
      INFO(n << " unknowns, tolerance " << tolerance);
      const End plain = run(n, tolerance, 0, spgmr), both = run(n, tolerance, 2, spgmr);
      REQUIRE(plain.flag >= 0);
      INFO(both.message);
      REQUIRE(both.flag >= 0);
      // As measured: a third more steps and twice the error at 400 unknowns.
      const double more = n == 100 ? 1.1 : 1.4, worse = n == 100 ? 1.5 : 2.5;
      CHECK(static_cast<double>(both.steps) <= more * static_cast<double>(plain.steps) + 5.0);
      CHECK(distance(both, exact) <= worse * distance(plain, exact));
    }
  }
}

TEST_CASE("what IDA keeps by itself leaves it alone, bit for bit, with an iterative solver") {
  for (const double tolerance : {1e-3, 1e-5, 1e-7})
    CHECK(same_bits(run(200, tolerance, 1, spgmr).y, run(200, tolerance, 0, spgmr).y));
}

TEST_CASE("every iterative solver of SUNDIALS") {
  const Make others[] = {
      [](N_Vector y, SUNContext c) { return SUNLinSol_SPFGMR(y, SUN_PREC_NONE, 10, c); },
      [](N_Vector y, SUNContext c) { return SUNLinSol_SPBCGS(y, SUN_PREC_NONE, 20, c); },
      [](N_Vector y, SUNContext c) { return SUNLinSol_SPTFQMR(y, SUN_PREC_NONE, 20, c); }};
  for (const Make make : others)
    for (const double tolerance : {1e-3, 1e-6}) {
      const End plain = run(200, tolerance, 0, make), both = run(200, tolerance, 2, make);
      REQUIRE(plain.flag >= 0);
      REQUIRE(both.flag >= 0);
      CHECK(static_cast<double>(both.steps) <= 1.4 * static_cast<double>(plain.steps) + 5.0);
    }
}
