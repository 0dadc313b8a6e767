// Smallest user of tether::ida_projection: a unit pendulum in index-1 form, kept on its length and
// on the velocity that goes with it. The same source links IDA or IDAS.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection.hpp>

namespace {

// y = (x, y, u, v, lambda): x'' = -lambda x, y'' = -lambda y - 1, lambda = u^2 + v^2 - y on r = 1.
int residual(sunrealtype, N_Vector yy, N_Vector yp, N_Vector rr, void*) {
  const double* y = N_VGetArrayPointer(yy);
  const double* d = N_VGetArrayPointer(yp);
  double* F = N_VGetArrayPointer(rr);
  F[0] = d[0] - y[2];
  F[1] = d[1] - y[3];
  F[2] = d[2] + y[4] * y[0];
  F[3] = d[3] + y[4] * y[1] + 1.0;
  F[4] = y[4] - (y[2] * y[2] + y[3] * y[3] - y[1]);
  return 0;
}

}  // namespace

bool use_ida_projection() {
  namespace tp = tether::ida_projection;

  SUNContext context = nullptr;
  SUNContext_Create(0, &context);
  N_Vector yy = N_VNew_Serial(5, context), yp = N_VClone(yy);
  N_VConst(0.0, yy);
  N_VConst(0.0, yp);
  N_VGetArrayPointer(yy)[0] = 1.0;   // horizontal, at rest
  N_VGetArrayPointer(yp)[3] = -1.0;  // falling

  void* ida_mem = IDACreate(context);
  IDAInit(ida_mem, residual, 0.0, yy, yp);
  IDASStolerances(ida_mem, 1e-6, 1e-6);
  SUNMatrix matrix = SUNDenseMatrix(5, 5, context);
  SUNLinearSolver linear_solver = SUNLinSol_Dense(yy, matrix, context);
  IDASetLinearSolver(ida_mem, linear_solver, matrix);

  tp::Constraints constraints;
  constraints.count = 2;
  constraints.value = [](double, tp::ConstVector y, tp::Vector g) {
    g[0] = 0.5 * (y[0] * y[0] + y[1] * y[1] - 1.0);
    g[1] = y[0] * y[2] + y[1] * y[3];
  };
  tp::Projection projection(ida_mem, constraints);

  double t = 0.0, drift = 0.0;
  int flag = 0;
  while (flag >= 0 && t < 10.0) {
    flag = IDASolve(ida_mem, 10.0, &t, yy, yp, IDA_ONE_STEP);
    const double* y = N_VGetArrayPointer(yy);
    drift = std::fmax(drift, std::fabs(std::hypot(y[0], y[1]) - 1.0));
  }
  const tp::Statistics statistics = projection.statistics();
  std::printf("t = %g, largest drift of the length %.1e, %ld projections\n", t, drift,
              statistics.projections);

  IDAFree(&ida_mem);
  SUNLinSolFree(linear_solver);
  SUNMatDestroy(matrix);
  N_VDestroy(yy);
  N_VDestroy(yp);
  SUNContext_Free(&context);
  return flag >= 0 && t >= 10.0 && drift < 1e-8 && statistics.projections > 0;
}
