// Tether: gradient of an integral over a pendulum's motion by the adjoint method of IDAS.
// SPDX-License-Identifier: BSD-3-Clause
//
// G(L, g) = int_0^T x^2 dt. The adjoint equation of a form of index 1 keeps no rows of its own, but
// the motion that IDAS interpolates for it leaves the constraints by the interpolation's error:
// `project` in the backward residual brings each point back.
#include <cmath>
#include <cstdio>
#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection.hpp>

namespace tp = tether::ida_projection;

namespace {

constexpr double kL = 1.3, kG = 9.8, kEnd = 5.0, kTolerance = 1e-10;

struct Motion {
  tp::Projection* projection = nullptr;
  N_Vector y = nullptr;  // a point of it, on the constraints
  const double* at(double t, N_Vector interpolated) const {
    N_VScale(1.0, interpolated, y);
    projection->project(t, y);
    return N_VGetArrayPointer(y);
  }
};

int forward(sunrealtype, N_Vector yy, N_Vector yyp, N_Vector rr, void*) {
  const double *y = N_VGetArrayPointer(yy), *yp = N_VGetArrayPointer(yyp);
  double* r = N_VGetArrayPointer(rr);
  r[0] = yp[0] - y[2];
  r[1] = yp[1] - y[3];
  r[2] = yp[2] + y[0] * y[4];
  r[3] = yp[3] + y[1] * y[4] + kG;
  r[4] = y[2] * y[2] + y[3] * y[3] - kG * y[1] - kL * kL * y[4];
  return 0;
}

// (z' F_y')' - z' F_y + d(x^2)/dy = 0 for z = lambda.
int backward(sunrealtype t, N_Vector yy, N_Vector, N_Vector zz, N_Vector zzp, N_Vector rr,
             void* data) {
  const double* y = static_cast<const Motion*>(data)->at(t, yy);
  const double *z = N_VGetArrayPointer(zz), *zp = N_VGetArrayPointer(zzp);
  double* r = N_VGetArrayPointer(rr);
  r[0] = zp[0] - z[2] * y[4] + 2.0 * y[0];
  r[1] = zp[1] - z[3] * y[4] + kG * z[4];
  r[2] = zp[2] + z[0] - 2.0 * y[2] * z[4];
  r[3] = zp[3] + z[1] - 2.0 * y[3] * z[4];
  r[4] = z[2] * y[0] + z[3] * y[1] - kL * kL * z[4];
  return 0;
}

// -z' F_p for p = (L, g).
int integrand(sunrealtype t, N_Vector yy, N_Vector, N_Vector zz, N_Vector, N_Vector qq,
              void* data) {
  const double* y = static_cast<const Motion*>(data)->at(t, yy);
  const double* z = N_VGetArrayPointer(zz);
  N_VGetArrayPointer(qq)[0] = 2.0 * kL * y[4] * z[4];
  N_VGetArrayPointer(qq)[1] = y[1] * z[4] - z[3];
  return 0;
}

tp::Constraints rows() {
  tp::Constraints set;
  set.count = 3;
  set.value = [](double, tp::ConstVector y, tp::Vector g) {
    g[0] = 0.5 * (y[0] * y[0] + y[1] * y[1] - kL * kL);
    g[1] = y[0] * y[2] + y[1] * y[3];
    g[2] = 0.5 * (y[2] * y[2] + y[3] * y[3]) + kG * y[1];
  };
  set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    C.row(0).head(2) = y.head(2);
    C.row(1) << y[2], y[3], y[0], y[1], 0.0;
    C.row(2) << 0.0, kG, y[2], y[3], 0.0;
  });
  return set;
}

// dG/dp by differences of the closed form, Simpson's rule in time.
double reference(bool by_length) {
  const auto G = [](double L, double g) {
    constexpr int n = 2000;
    double sum = 0.0;
    for (int i = 0; i <= n; ++i) {
      double y[5];
      tether::problems::pendulum_exact(L, g, kEnd * i / n, y);
      sum += (i == 0 || i == n ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * y[0] * y[0];
    }
    return sum * kEnd / n / 3.0;
  };
  const auto at = [&](double d) { return by_length ? G(kL + d, kG) : G(kL, kG + d); };
  const double d = 1e-3 * (by_length ? kL : kG);
  return (8.0 * (at(d) - at(-d)) - (at(2.0 * d) - at(-2.0 * d))) / (12.0 * d);
}

bool failed(int flag, const char* what) {
  if (flag < 0) std::printf("%s returned %d\n", what, flag);
  return flag < 0;
}

}  // namespace

int main() {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  SUNContext_Create(SUN_COMM_NULL, &context);
#else
  SUNContext_Create(nullptr, &context);
#endif
  N_Vector y = N_VNew_Serial(5, context), yp = N_VClone(y), z = N_VClone(y), zp = N_VClone(y);
  N_Vector point = N_VClone(y), q = N_VNew_Serial(2, context);
  for (N_Vector v : {y, yp, z, zp, q}) N_VConst(0.0, v);
  N_VGetArrayPointer(y)[0] = kL;
  N_VGetArrayPointer(yp)[3] = -kG;
  SUNMatrix A = SUNDenseMatrix(5, 5, context), B = SUNDenseMatrix(5, 5, context);
  SUNLinearSolver solver = SUNLinSol_Dense(y, A, context), back = SUNLinSol_Dense(y, B, context);

  // Forward, projected, with checkpoints.
  void* ida_mem = IDACreate(context);
  IDAInit(ida_mem, forward, 0.0, y, yp);
  IDASStolerances(ida_mem, kTolerance, kTolerance);
  IDASetLinearSolver(ida_mem, solver, A);
  IDASetMaxNumSteps(ida_mem, 100000);
  tp::Projection projection(ida_mem, rows());
  Motion motion{&projection, point};
  // More steps than the run takes: no part of it is repeated from a checkpoint, see the guide.
  IDAAdjInit(ida_mem, 20000, IDA_HERMITE);
  int which = 0, checkpoints = 0;
  sunrealtype t = 0.0;
  if (failed(IDASolveF(ida_mem, kEnd, &t, y, yp, IDA_NORMAL, &checkpoints), "IDASolveF")) return 1;

  // Backward from lambda(T) = 0, lambda'(T) = -(2 x, 0, ...). Where G depends on y(T) itself, only
  // the part of its gradient along the motions matters: project() of y(T) comes first.
  N_VGetArrayPointer(zp)[0] = -2.0 * motion.at(kEnd, y)[0];
  IDACreateB(ida_mem, &which);
  IDAInitB(ida_mem, which, backward, kEnd, z, zp);
  IDASetUserDataB(ida_mem, which, &motion);
  IDASStolerancesB(ida_mem, which, kTolerance, kTolerance);
  IDASetLinearSolverB(ida_mem, which, back, B);
  IDASetMaxNumStepsB(ida_mem, which, 100000);
  IDAQuadInitB(ida_mem, which, integrand, q);
  IDAQuadSStolerancesB(ida_mem, which, kTolerance, kTolerance);
  IDASetQuadErrConB(ida_mem, which, 1);
  if (failed(IDASolveB(ida_mem, 0.0, IDA_NORMAL), "IDASolveB")) return 1;
  IDAGetB(ida_mem, which, &t, z, zp);
  IDAGetQuadB(ida_mem, which, &t, q);

  // y(0) = (L, 0, ...): lambda(0)' dy(0)/dL is lambda_x. Quadratures run backwards.
  const double found[2] = {-N_VGetArrayPointer(q)[0] + N_VGetArrayPointer(z)[0],
                           -N_VGetArrayPointer(q)[1]};
  double worst = 0.0;
  for (const int k : {0, 1}) {
    const double expected = reference(k == 0), error = std::abs(found[k] / expected - 1.0);
    std::printf("dG/d%s = %.8f, relative error %.1e\n", k == 0 ? "L" : "g", found[k], error);
    worst = std::max(worst, error);
  }
  IDAFree(&ida_mem);
  for (SUNLinearSolver s : {solver, back}) SUNLinSolFree(s);
  for (SUNMatrix m : {A, B}) SUNMatDestroy(m);
  for (N_Vector v : {y, yp, z, zp, point, q}) N_VDestroy(v);
  SUNContext_Free(&context);
  return worst < 1e-6 ? 0 : 1;
}
