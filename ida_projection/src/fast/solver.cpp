// Tether: a SUNLinearSolver for small dense matrices. SPDX-License-Identifier: BSD-3-Clause
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <tether/ida_projection/fast.hpp>
#include <tether/linalg/small_lu.hpp>

#include "arguments.hpp"

namespace tether::ida_projection {

namespace {

static_assert(kLargestFastDense == linalg::SmallLU::kLargest);

struct Content {
  linalg::SmallLU lu;
  sunindextype size = 0;
  sunindextype last_flag = 0;
};

Content& content(SUNLinearSolver solver) { return *static_cast<Content*>(solver->content); }

#ifdef SUN_COMM_NULL  // SUNDIALS 7
constexpr int kSuccess = SUN_SUCCESS, kWrongMatrix = SUN_ERR_ARG_OUTOFRANGE;
#else
constexpr int kSuccess = SUNLS_SUCCESS, kWrongMatrix = SUNLS_ILL_INPUT;
#endif

SUNLinearSolver_Type get_type(SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; }
SUNLinearSolver_ID get_id(SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; }

int initialize(SUNLinearSolver solver) {
  content(solver).last_flag = kSuccess;
  return kSuccess;
}

int setup(SUNLinearSolver solver, SUNMatrix A) {
  Content& c = content(solver);
  if (!A || SUNMatGetID(A) != SUNMATRIX_DENSE || SM_ROWS_D(A) != c.size ||
      SM_COLUMNS_D(A) != c.size) {
    c.last_flag = kWrongMatrix;
    return kWrongMatrix;
  }
  c.last_flag = c.lu.factor(SM_DATA_D(A), static_cast<int>(c.size));
  return c.last_flag > 0 ? SUNLS_LUFACT_FAIL : kSuccess;
}

int solve(SUNLinearSolver solver, SUNMatrix A, N_Vector x, N_Vector b, sunrealtype) {
  Content& c = content(solver);
  c.lu.solve(SM_DATA_D(A), NV_DATA_S(b), NV_DATA_S(x));
  c.last_flag = kSuccess;
  return kSuccess;
}

sunindextype last_flag(SUNLinearSolver solver) { return content(solver).last_flag; }

int space(SUNLinearSolver, long* reals, long* integers) {
  *reals = 0;
  *integers = static_cast<long>(sizeof(Content) / sizeof(int));
  return kSuccess;
}

int destroy(SUNLinearSolver solver) {
  if (!solver) return kSuccess;
  delete static_cast<Content*>(solver->content);
  solver->content = nullptr;
  SUNLinSolFreeEmpty(solver);
  return kSuccess;
}

std::string size_of(SUNMatrix A) {
  return std::to_string(SM_ROWS_D(A)) + " x " + std::to_string(SM_COLUMNS_D(A));
}

void require_small_dense(N_Vector y, SUNMatrix A) {
  fast::require_serial(y, "fast_dense_solver: y");
  if (!A) fast::refuse("fast_dense_solver: A is null; want a matrix of SUNDenseMatrix");
  if (!A->ops || !A->ops->getid || A->ops->getid(A) != SUNMATRIX_DENSE)
    fast::refuse("fast_dense_solver: A is not a dense matrix; want one of SUNDenseMatrix");
  if (SM_ROWS_D(A) != SM_COLUMNS_D(A))
    fast::refuse("fast_dense_solver: A is " + size_of(A) + "; want a square matrix");
  if (SM_ROWS_D(A) != NV_LENGTH_S(y))
    fast::refuse("fast_dense_solver: A is " + size_of(A) + ", but y has " +
                 std::to_string(NV_LENGTH_S(y)) + " elements; want as many");
  if (SM_ROWS_D(A) < 1 || SM_ROWS_D(A) > kLargestFastDense)
    fast::refuse("fast_dense_solver: A is " + size_of(A) + "; want 1 to " +
                 std::to_string(kLargestFastDense) + " rows (SUNLinSol_Dense takes any number)");
}

}  // namespace

SUNLinearSolver fast_dense_solver(N_Vector y, SUNMatrix A) {
  check_running_sundials(TETHER_SUNDIALS_BUILD);
  require_small_dense(y, A);
  SUNLinearSolver solver = SUNLinSolNewEmpty(y->sunctx);
  if (!solver) throw std::runtime_error("fast_dense_solver: SUNLinSolNewEmpty gave no solver");
  solver->ops->gettype = get_type;
  solver->ops->getid = get_id;
  solver->ops->initialize = initialize;
  solver->ops->setup = setup;
  solver->ops->solve = solve;
  solver->ops->lastflag = last_flag;
  solver->ops->space = space;
  solver->ops->free = destroy;
  auto* made = new Content;
  made->size = SM_ROWS_D(A);
  solver->content = made;
  return solver;
}

}  // namespace tether::ida_projection
