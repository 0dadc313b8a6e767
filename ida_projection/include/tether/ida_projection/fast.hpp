// Tether: faster vectors and dense factors for SUNDIALS on small systems; needs no constraints.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <sundials/sundials_nvector.h>
#include <tether/export.hpp>
#include <tether/ida_projection/sundials_build.hpp>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// Makes the operations of a serial vector faster, and of every vector cloned from it afterwards:
/// called on y before IDAInit, all of IDA's vectors are fast. Returns y.
///
/// Overwrites y->ops with kernels that give SUNDIALS' results bit for bit: every sum in its order,
/// no fused multiply-add. (A SUNDIALS compiled for processors that have them, by -march=native,
/// rounds in its own way.) The content stays that of N_VNew_Serial, with all its accessors; vectors
/// of up to 16 elements get kernels for their length, so y keeps its length. Fused operations that
/// a program enabled are replaced by some with their bits.
///
/// Throws std::invalid_argument for a null pointer and for any other vector than a serial one.
N_Vector fast_vector(N_Vector y);

/// Both vectors that IDASolve returns y and y' in: IDA works in them at every step.
void fast_vector(N_Vector y, N_Vector yp);

/// LU with partial pivoting for a dense, square matrix of up to 64 rows: SUNLinSol_Dense with its
/// pivots and its bits, without its copies. Factors are written over A, as there. Free it with
/// SUNLinSolFree; it is of type SUNLINEARSOLVER_DIRECT and says SUNLINEARSOLVER_CUSTOM for its id.
///
/// y: a serial vector with as many elements as A has rows; any serial vectors may be solved for.
/// Throws std::invalid_argument for a null pointer, a vector that is not serial, a matrix that is
/// not dense, not square, of another size than y, or larger than 64.
SUNLinearSolver fast_dense_solver(N_Vector y, SUNMatrix A);

/// Largest matrix of fast_dense_solver.
constexpr int kLargestFastDense = 64;

}  // namespace tether::ida_projection
TETHER_EXPORT_END
