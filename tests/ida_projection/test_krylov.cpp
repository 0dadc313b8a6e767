// Tether: hosts whose linear solver is iterative. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#ifdef TETHER_TEST_OPENMP
#include <nvector/nvector_openmp.h>
#endif
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunlinsol/sunlinsol_pcg.h>
#include <sunlinsol/sunlinsol_spbcgs.h>
#include <sunlinsol/sunlinsol_spfgmr.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunlinsol/sunlinsol_sptfqmr.h>
#include <sunmatrix/sunmatrix_band.h>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

constexpr double kTurn = 6.28318530717958648;

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

/// cj and the diagonal of d f/d u, as a preconditioner.
struct Diagonal {
  std::vector<double> entries;

  static int set_up(sunrealtype, N_Vector y, N_Vector, N_Vector, sunrealtype cj, void* data) {
    std::vector<double>& d = static_cast<Diagonal*>(data)->entries;
    const auto n = static_cast<std::size_t>(N_VGetLength(y));
    const double* u = N_VGetArrayPointer(y);
    d.resize(n);
    for (std::size_t i = 0; i < n; ++i)
      d[i] = cj + (u[(i + 1) % n] - u[(i + n - 1) % n]) * static_cast<double>(n) / 6.0;
    return 0;
  }
  static int solve(sunrealtype, N_Vector, N_Vector, N_Vector, N_Vector r, N_Vector z, sunrealtype,
                   sunrealtype, void* data) {
    const std::vector<double>& d = static_cast<Diagonal*>(data)->entries;
    for (std::size_t i = 0; i < d.size(); ++i)
      N_VGetArrayPointer(z)[i] = N_VGetArrayPointer(r)[i] / d[i];
    return 0;
  }
};

using Make = SUNLinearSolver (*)(N_Vector, int preconditioning, SUNContext);

const Make spgmr = [](N_Vector y, int p, SUNContext c) { return SUNLinSol_SPGMR(y, p, 10, c); };
const Make pcg = [](N_Vector y, int p, SUNContext c) { return SUNLinSol_PCG(y, p, 10, c); };
const Make band = nullptr;  // SUNDIALS' direct solver

/// Who solves it, and how far.
struct Burgers {
  int unknowns;
  Make make = spgmr;
  double end = 0.1;
  bool preconditioned = false, open_mp = false;
};

struct End {
  int flag = 0;
  long steps = 0;
  std::vector<double> y;
  tp::Statistics statistics;
  std::string message;
};

/// rows: 0 plain IDA, 1 mass, 2 mass and energy.
End run(const Burgers& host, double tolerance, int rows) {
  Context context;
  const int n = host.unknowns;
  N_Vector y = N_VNew_Serial(n, context);
#ifdef TETHER_TEST_OPENMP
  if (host.open_mp) {
    N_VDestroy(y);
    y = N_VNew_OpenMP(n, 2, context);
  }
#endif
  N_Vector yp = N_VClone(y), f = N_VClone(y);
  for (int i = 0; i < n; ++i) N_VGetArrayPointer(y)[i] = 1.5 + std::sin(kTurn * (i + 0.5) / n);
  N_VConst(0.0, yp);
  burgers(0.0, y, yp, f, nullptr);
  N_VScale(-1.0, f, yp);
  Diagonal diagonal;
  void* ida = IDACreate(context);
  IDAInit(ida, burgers, 0.0, y, yp);
  IDASetUserData(ida, &diagonal);
  IDASStolerances(ida, tolerance, tolerance);
  IDASetMaxNumSteps(ida, 20000);
  SUNMatrix matrix = host.make == band ? SUNBandMatrix(n, 1, 1, context) : nullptr;
  const int side = host.preconditioned ? SUN_PREC_LEFT : SUN_PREC_NONE;
  SUNLinearSolver solver =
      matrix != nullptr ? SUNLinSol_Band(y, matrix, context) : host.make(y, side, context);
  IDASetLinearSolver(ida, solver, matrix);
  if (host.preconditioned) IDASetPreconditioner(ida, Diagonal::set_up, Diagonal::solve);
  End end;
  {
    std::unique_ptr<tp::Projection> projection;
    tp::Options options;
    options.print = false;
    if (rows > 0) projection = std::make_unique<tp::Projection>(ida, kept(y, rows == 2), options);
    sunrealtype t = 0.0;
    while (t < host.end && end.flag >= 0)
      end.flag = IDASolve(ida, host.end, &t, y, yp, IDA_ONE_STEP);
    if (end.flag >= 0) IDAGetDky(ida, host.end, 0, y);
    IDAGetNumSteps(ida, &end.steps);
    if (projection) end.message = projection->message();
    if (projection) end.statistics = projection->statistics();
    end.y.assign(N_VGetArrayPointer(y), N_VGetArrayPointer(y) + n);
    IDAFree(&ida);
  }
  SUNLinSolFree(solver);
  if (matrix != nullptr) SUNMatDestroy(matrix);
  for (N_Vector v : {y, yp, f}) N_VDestroy(v);
  return end;
}

double distance(const End& a, const End& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.y.size(); ++i)
    largest = std::max(largest, std::abs(a.y[i] - b.y[i]));
  return largest;
}

/// Steps and error with both rows are those of plain IDA.
void same_as_plain(const Burgers& host, double tolerance, const End& exact) {
  INFO(host.unknowns << " unknowns, tolerance " << tolerance);
  const End plain = run(host, tolerance, 0), both = run(host, tolerance, 2);
  REQUIRE(plain.flag >= 0);
  INFO(both.message);
  REQUIRE(both.flag >= 0);
  CHECK(static_cast<double>(both.steps) <= 1.1 * static_cast<double>(plain.steps) + 2.0);
  CHECK(distance(both, exact) <= 1.2 * distance(plain, exact) + 0.1 * tolerance);
  CHECK(both.statistics.extra_iterations == 0);
  CHECK(both.statistics.corrections_repeated == 0);
}

Burgers tight(Burgers host) {
  host.make = band;
  host.preconditioned = host.open_mp = false;
  return host;
}

}  // namespace

TEST_CASE("Burgers' equation, mass and energy kept: GMRES takes plain IDA's steps to its errors") {
  for (const int n : {100, 400}) {
    const Burgers host{n};
    const End exact = run(tight(host), 1e-11, 0);
    for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6, 1e-7})
      same_as_plain(host, tolerance, exact);
  }
}

TEST_CASE("the same with 10 000 and 20 000 unknowns, preconditioned and on OpenMP vectors") {
  Burgers host{10000, spgmr, 0.001};
  End exact = run(tight(host), 1e-8, 0);
  for (const double tolerance : {1e-3, 1e-6}) same_as_plain(host, tolerance, exact);
  host = {20000, spgmr, 0.001, true};
  exact = run(tight(host), 1e-8, 0);
  for (const double tolerance : {1e-3, 1e-6}) same_as_plain(host, tolerance, exact);
#ifdef TETHER_TEST_OPENMP
  host.open_mp = true;
  same_as_plain(host, 1e-6, exact);
#endif
}

TEST_CASE("what IDA keeps by itself leaves it alone, bit for bit, with an iterative solver") {
  for (const double tolerance : {1e-3, 1e-5, 1e-7})
    CHECK(same_bits(run({200}, tolerance, 1).y, run({200}, tolerance, 0).y));
}

TEST_CASE("every iterative solver of SUNDIALS") {
  const Make others[] = {
      pcg, [](N_Vector y, int p, SUNContext c) { return SUNLinSol_SPFGMR(y, p, 10, c); },
      [](N_Vector y, int p, SUNContext c) { return SUNLinSol_SPBCGS(y, p, 20, c); },
      [](N_Vector y, int p, SUNContext c) { return SUNLinSol_SPTFQMR(y, p, 20, c); }};
  for (const Make make : others) {
    const Burgers host{200, make};
    const End exact = run(tight(host), 1e-10, 0);
    for (const double tolerance : {1e-3, 1e-6}) same_as_plain(host, tolerance, exact);
  }
}
