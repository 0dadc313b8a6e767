// Tether: MUMPS as linear solver of IDA over MPI ranks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mpi.h>
#include <nvector/nvector_parallel.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

#include <vector>

/// The rows of J = dF/dy + cj dF/dy' that belong to this rank's unknowns, as a list. Entries of the
/// same place are added.
struct RankEntries {
  std::vector<int> rows, columns;  ///< global, from 1
  std::vector<double> values;

  /// Row and column from 0.
  void add(long long row, long long column, double value) {
    rows.push_back(static_cast<int>(row) + 1);
    columns.push_back(static_cast<int>(column) + 1);
    values.push_back(value);
  }
};

/// A matrix for IDASetLinearSolver; IDA's Jacobian function fills entries_of() it, which IDA
/// empties before. To be freed by SUNMatDestroy.
SUNMatrix new_rank_matrix(SUNContext context);
RankEntries& entries_of(SUNMatrix matrix);

/// Direct solver for such matrices and vectors like y (parallel). Factors stay over the ranks,
/// right sides are gathered on the first. A singular J is a recoverable failure; the analysis is
/// repeated where places of entries have changed. To be freed by SUNLinSolFree, before
/// MPI_Finalize. P. R. Amestoy, I. S. Duff, J. Koster, J.-Y. L'Excellent, A fully asynchronous
/// multifrontal solver using distributed dynamic scheduling, SIAM J. Matrix Anal. Appl. 23
/// (2001) 15.
SUNLinearSolver new_mumps_solver(N_Vector y, SUNContext context);
