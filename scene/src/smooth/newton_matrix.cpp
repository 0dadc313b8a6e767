// Tether: IDA's matrix of a smooth system and its solver. SPDX-License-Identifier: BSD-3-Clause
#include "newton_matrix.hpp"

#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#ifdef TETHER_SCENE_KLU
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#endif

#include <algorithm>
#include <numeric>
#include <tether/ida_projection.hpp>

#include "smooth/rows/elimination_order.hpp"
#include "smooth/rows/sizes.hpp"

namespace tether::scene::smooth {

#ifdef TETHER_SCENE_KLU
namespace {

// SUNDIALS calls KLU's singular matrix unrecoverable, and its next setups want the factors that
// were not made. A predictor may meet a dead point exactly; another step passes by.
int factor_or_try_smaller_step(SUNLinearSolver solver, SUNMatrix matrix) {
  if (SUNLinSolSetup_KLU(solver, matrix) == 0) return 0;
  SUNLinSol_KLUReInit(solver, matrix, 0, SUNKLU_REINIT_PARTIAL);
  return 1;
}

// The order that is the user_data of KLU's settings. Nothing is said about the fill.
template <class Int, class Common>
Int given_order(Int count, Int*, Int*, Int* order, Common* settings) {
  const auto& given = *static_cast<const std::vector<int>*>(settings->user_data);
  if (count != static_cast<Int>(given.size())) return 0;
  std::copy(given.begin(), given.end(), order);
  return -1;
}

// KLU's own orders are for any matrix: AMD takes multipliers, whose diagonal is zero, before their
// bodies, pivots then leave its order, and the fill is large (net of 20 x 20 balls: ten times the
// time); COLAMD leaves the diagonal from the start.
void use_order(SUNLinearSolver solver, std::vector<int>& order) {
  constexpr int kOwnOrder = 3;
  auto* settings = SUNLinSol_KLUGetCommon(solver);
  settings->ordering = kOwnOrder;
  settings->btf = 0;
  settings->user_order = given_order;
  settings->user_data = &order;
}

}  // namespace
#endif

NewtonMatrix::NewtonMatrix(System& system, double t, N_Vector y, N_Vector yp, SUNContext context)
    : system_(system) {
  entries_.record();
  system_.jacobian(t, 1.0, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), entries_);
#ifdef TETHER_SCENE_KLU
  if (system_.size() >= kManyUnknowns) {
    make_sparse(y, context);
    return;
  }
#endif
  make_dense(y, context);
}

NewtonMatrix::~NewtonMatrix() {
  SUNLinSolFree(solver_);
  SUNMatDestroy(matrix_);
}

void NewtonMatrix::make_dense(N_Vector y, SUNContext context) {
  const int N = system_.size();
  const auto& places = entries_.places;
  std::vector<int> slots(places.size());
  for (std::size_t k = 0; k < places.size(); ++k) slots[k] = places[k].first + N * places[k].second;
  matrix_ = SUNDenseMatrix(N, N, context);
  solver_ = N <= ida_projection::kLargestFastDense ? ida_projection::fast_dense_solver(y, matrix_)
                                                   : SUNLinSol_Dense(y, matrix_, context);
  entries_.finish(std::move(slots));
}

#ifdef TETHER_SCENE_KLU
void NewtonMatrix::make_sparse(N_Vector y, SUNContext context) {
  const int N = system_.size();
  const auto& places = entries_.places;
  std::vector<int> slots(places.size());
  std::vector<std::size_t> order(places.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto column_first = [&](std::size_t a, std::size_t b) {
    return std::pair(places[a].second, places[a].first) <
           std::pair(places[b].second, places[b].first);
  };
  std::sort(order.begin(), order.end(), column_first);
  column_starts_.assign(static_cast<std::size_t>(N) + 1, 0);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const auto [row, column] = places[order[k]];
    if (k == 0 || places[order[k - 1]] != places[order[k]]) {
      row_indices_.push_back(row);
      ++column_starts_[static_cast<std::size_t>(column) + 1];
    }
    slots[order[k]] = static_cast<int>(row_indices_.size()) - 1;
  }
  std::partial_sum(column_starts_.begin(), column_starts_.end(), column_starts_.begin());
  matrix_ = SUNSparseMatrix(N, N, static_cast<sunindextype>(row_indices_.size()), CSC_MAT, context);
  solver_ = SUNLinSol_KLU(y, matrix_, context);
  if (by_entries(system_.rows(), system_.moving())) {
    order_ = elimination_order(N, system_.moving(), kBody, kVelocity, places);
    use_order(solver_, order_);
  }
  solver_->ops->setup = factor_or_try_smaller_step;
  entries_.finish(std::move(slots));
}
#endif

void NewtonMatrix::fill(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J) {
  double* values = nullptr;
#ifdef TETHER_SCENE_KLU
  if (!row_indices_.empty()) {
    std::copy(column_starts_.begin(), column_starts_.end(), SUNSparseMatrix_IndexPointers(J));
    std::copy(row_indices_.begin(), row_indices_.end(), SUNSparseMatrix_IndexValues(J));
    values = SUNSparseMatrix_Data(J);
    std::fill(values, values + row_indices_.size(), 0.0);
    if (multiplier_choices_ != system_.multiplier_choices()) {
      multiplier_choices_ = system_.multiplier_choices();
      SUNLinSol_KLUReInit(solver_, J, 0, SUNKLU_REINIT_PARTIAL);  // other pivots
    }
  }
#endif
  if (!values) {
    SUNMatZero(J);
    values = SUNDenseMatrix_Data(J);
  }
  entries_.begin(values);
  system_.jacobian(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), entries_);
}

}  // namespace tether::scene::smooth
