// Tether: fast operations of serial vectors, and a SUNLinearSolver for small dense matrices.
// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <nvector/nvector_serial.h>
#include <stdexcept>
#include <string>
#include <sundials/sundials_version.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <tether/ida_projection/fast.hpp>
#include <tether/linalg/small_lu.hpp>

#include "fast/kernels.hpp"
#include "host/owned_vector.hpp"

// A host without serial vectors may lack it: then there is nothing to be made fast.
#pragma weak N_VNewEmpty_Serial

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
constexpr int kWrongMatrix = SUN_ERR_ARG_OUTOFRANGE;
#else
constexpr int kWrongMatrix = SUNLS_ILL_INPUT;
#endif

int setup(SUNLinearSolver solver, SUNMatrix A) {
  Content& c = content(solver);
  const bool right = A != nullptr && SUNMatGetID(A) == SUNMATRIX_DENSE && SM_ROWS_D(A) == c.size &&
                     SM_COLUMNS_D(A) == c.size;
  c.last_flag = right ? c.lu.factor(SM_DATA_D(A), static_cast<int>(c.size)) : kWrongMatrix;
  return c.last_flag > 0 ? SUNLS_LUFACT_FAIL : static_cast<int>(c.last_flag);
}

int solve(SUNLinearSolver solver, SUNMatrix A, N_Vector x, N_Vector b, sunrealtype) {
  content(solver).lu.solve(SM_DATA_D(A), NV_DATA_S(b), NV_DATA_S(x));
  return 0;
}

int destroy(SUNLinearSolver solver) {
  if (!solver) return 0;
  delete static_cast<Content*>(solver->content);
  SUNLinSolFreeEmpty(solver);
  return 0;
}

bool is_serial(N_Vector v) {
  return v != nullptr && v->ops->nvgetvectorid != nullptr &&
         v->ops->nvgetvectorid(v) == SUNDIALS_NVEC_SERIAL && v->content != nullptr;
}

// All but those of its making and its end, which the plugin itself may watch.
bool same_operations(_generic_N_Vector_Ops own, const _generic_N_Vector_Ops& untouched) {
  own.nvclone = untouched.nvclone;
  own.nvcloneempty = untouched.nvcloneempty;
  own.nvdestroy = untouched.nvdestroy;
  return std::memcmp(&own, &untouched, sizeof own) == 0;
}

// A SUNDIALS compiled with fused multiply-adds has other bits than the kernels.
bool rounds_one_by_one(N_Vector like) {
  const OwnedVector x(like), y(like), sum(like);
  const double a = 1.0 + 0x1p-27;  // a^2 - 1 is 2^-26, fused 2^-26 + 2^-54
  N_VConst(a, x);
  N_VConst(-1.0, y);
  N_VLinearSum(a, x, 1.0, y, sum);
  const double* sums = N_VGetArrayPointer(sum);
  for (sunindextype i = 0; i < NV_LENGTH_S(like); ++i)
    if (sums[i] != 0x1p-26) return false;
  return true;
}

void require(bool right, const std::string& otherwise) {
  if (!right) throw std::invalid_argument(otherwise);
}

/// `name` says whose argument it is.
void require_serial(N_Vector v, const std::string& name) {
  const std::string wanted = "; want a vector of N_VNew_Serial or N_VMake_Serial";
  require(v != nullptr, name + " is null" + wanted);
  require(is_serial(v), name + " is not a serial vector" + wanted);
}

void require_small_dense(N_Vector y, SUNMatrix A) {
  require_serial(y, "fast_dense_solver: y");
  const std::string its = "fast_dense_solver: A is ";
  require(A != nullptr, its + "null; want a matrix of SUNDenseMatrix");
  require(A->ops->getid != nullptr && A->ops->getid(A) == SUNMATRIX_DENSE,
          its + "not a dense matrix; want one of SUNDenseMatrix");
  const sunindextype n = SM_ROWS_D(A);
  const std::string size = its + std::to_string(n) + " x " + std::to_string(SM_COLUMNS_D(A));
  require(n == SM_COLUMNS_D(A), size + "; want a square matrix");
  require(n == NV_LENGTH_S(y),
          size + ", but y has " + std::to_string(NV_LENGTH_S(y)) + " elements; want as many");
  require(n >= 1 && n <= kLargestFastDense, size + "; want 1 to " +
                                                std::to_string(kLargestFastDense) +
                                                " rows (SUNLinSol_Dense takes any number)");
}

}  // namespace

namespace fast {

void quicken(std::initializer_list<N_Vector> vectors, bool with_inputs) {
  if (&N_VNewEmpty_Serial == nullptr) return;
  Owned<N_Vector, N_VDestroy> untouched;
  for (N_Vector v : vectors) {
    if (!is_serial(v)) continue;
    if (!untouched) untouched.reset(N_VNewEmpty_Serial(NV_LENGTH_S(v), v->sunctx));
    if (!untouched) return;
    if (!same_operations(*v->ops, *untouched->ops)) continue;
    static const bool same_bits = rounds_one_by_one(v);
    if (same_bits) install_kernels(v->ops, NV_LENGTH_S(v), with_inputs);
  }
}

}  // namespace fast

N_Vector fast_vector(N_Vector y) {
  check_running_sundials(TETHER_SUNDIALS_BUILD);
  require_serial(y, "fast_vector: y");
  check_running_indices(y);
  fast::install_kernels(y->ops, NV_LENGTH_S(y), false);
  return y;
}

void fast_vector(N_Vector y, N_Vector yp) {
  require_serial(yp, "fast_vector: yp");
  fast_vector(y);
  fast_vector(yp);
}

SUNLinearSolver fast_dense_solver(N_Vector y, SUNMatrix A) {
  check_running_sundials(TETHER_SUNDIALS_BUILD);
  require_small_dense(y, A);
  SUNLinearSolver solver = SUNLinSolNewEmpty(y->sunctx);
  if (!solver) throw std::runtime_error("fast_dense_solver: SUNLinSolNewEmpty gave no solver");
  const SUNLinearSolver_Ops ops = solver->ops;
  ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
  ops->getid = [](SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; };
  ops->setup = setup;
  ops->solve = solve;
  ops->lastflag = [](SUNLinearSolver s) { return content(s).last_flag; };
  ops->free = destroy;
  auto* made = new Content;
  made->size = SM_ROWS_D(A);
  solver->content = made;
  return solver;
}

}  // namespace tether::ida_projection
