// Tether: what must be refused. SPDX-License-Identifier: BSD-3-Clause
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <cmath>

#include "hard_case.hpp"
#include <tether/ida_projection.hpp>

#include <problems/rows.hpp>

#include "projection/context.hpp"

namespace tether::hard_cases {

namespace {

using ida_projection::Constraints;

// y' = 0 in the plane: the constraints alone decide.
int at_rest(sunrealtype, N_Vector, N_Vector yp, N_Vector r, void*) {
  N_VScale(1.0, yp, r);
  return 0;
}

struct Made {
  ida_projection::ConsistencyReport report;
  double x = 0.0, y = 0.0;
};

Made make_consistent(const Constraints& rows, double x, double y) {
  SUNContext context = bench::make_context();
  N_Vector state = N_VNew_Serial(2, context), rate = N_VClone(state);
  N_VGetArrayPointer(state)[0] = x;
  N_VGetArrayPointer(state)[1] = y;
  N_VConst(0.0, rate);
  void* ida = IDACreate(context);
  IDAInit(ida, at_rest, 0.0, state, rate);
  IDASStolerances(ida, 1e-8, 1e-8);
  SUNMatrix matrix = SUNDenseMatrix(2, 2, context);
  SUNLinearSolver solver = SUNLinSol_Dense(state, matrix, context);
  IDASetLinearSolver(ida, solver, matrix);
  Made made;
  {
    ida_projection::Projection projection(ida, rows);
    ida_projection::Consistency how;
    how.derivative = ida_projection::Consistency::Derivative::keep;
    made.report = projection.make_consistent(0.0, state, rate, how);
    IDAFree(&ida);
  }
  made.x = N_VGetArrayPointer(state)[0];
  made.y = N_VGetArrayPointer(state)[1];
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  N_VDestroy(state);
  N_VDestroy(rate);
  SUNContext_Free(&context);
  return made;
}

Constraints circle(double squared_radius) {
  return problems::make_rows(
             "circle", {"circle"},
             [=](double, const double* y, double* g) {
               g[0] = y[0] * y[0] + y[1] * y[1] - squared_radius;
             },
             [](double, const double* y, double* C) {
               C[0] = 2.0 * y[0];
               C[1] = 2.0 * y[1];
             })
      .constraints;
}

Constraints line(double x) {
  return problems::make_rows(
             "line", {"line"}, [=](double, const double* y, double* g) { g[0] = y[0] - x; },
             [](double, const double*, double* C) { C[0] = 1.0; })
      .constraints;
}

Constraints squared_circle() {
  return problems::make_rows(
             "squared", {"squared circle"},
             [](double, const double* y, double* g) {
               const double f = y[0] * y[0] + y[1] * y[1] - 1.0;
               g[0] = f * f;
             },
             [](double, const double* y, double* C) {
               const double f = y[0] * y[0] + y[1] * y[1] - 1.0;
               C[0] = 4.0 * f * y[0];
               C[1] = 4.0 * f * y[1];
             })
      .constraints;
}

const char* const kNoRows = "knows no rows: runs on in silence";

HardCase refusal(const std::string& name, const std::string& oracle, const Constraints& rows,
                 double x, double y) {
  return {name, "no solution", oracle, [=] {
            const Made made = make_consistent(rows, x, y);
            const bool kept = made.x == x && made.y == y;
            Outcome outcome;
            outcome.plain = kNoRows;
            outcome.right = !made.report && !made.report.message.empty() && kept;
            outcome.ours = made.report ? "accepted" : "refused: " + made.report.message;
            return outcome;
          }};
}

}  // namespace

std::vector<HardCase> refusals() {
  return {
      refusal("circles x^2+y^2 = 1 and 2", "least squares stalls at r^2 = 1.5",
              circle(1.0) + circle(2.0), 1.1, 0.2),
      refusal("x = 0 and x = 1e-3", "least squares stalls at 5e-4", line(0.0) + line(1e-3), 0.0,
              0.3),
      refusal("circle and a line beside it", "gradients are independent, no common point",
              circle(1.0) + line(2.0), 1.1, 0.2),
      refusal("x^2 + y^2 = -1", "no real point", circle(-1.0), 1.1, 0.2),
      {"(x^2+y^2-1)^2 = 0", "gradient vanishes on the set",
       "Gauss-Newton halves the distance; |g| says nothing about it",
       [] {
         const Made made = make_consistent(squared_circle(), 1.1, 0.2);
         const double distance = std::abs(std::hypot(made.x, made.y) - 1.0);
         Outcome outcome;
         outcome.plain = kNoRows;
         outcome.ours =
             (made.report ? "accepted" : "refused") +
             std::string(made.report.slow_convergence ? ", slow convergence reported" : "") + ": " +
             made.report.message;
         outcome.right = !made.report || (made.report.slow_convergence && distance < 1e-3);
         return outcome;
       }},
  };
}

}  // namespace tether::hard_cases
