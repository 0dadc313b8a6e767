// Tether: MUMPS as linear solver of IDA over MPI ranks. SPDX-License-Identifier: BSD-3-Clause
#include "mumps_solver.hpp"

#include <dmumps_c.h>

namespace {

SUNMatrix_ID matrix_id(SUNMatrix) { return SUNMATRIX_CUSTOM; }
int zero(SUNMatrix matrix) {
  RankEntries& entries = entries_of(matrix);
  entries.rows.clear();
  entries.columns.clear();
  entries.values.clear();
  return 0;
}
void destroy(SUNMatrix matrix) {
  delete &entries_of(matrix);
  SUNMatFreeEmpty(matrix);
}

class Mumps {
 public:
  explicit Mumps(N_Vector y) : comm_(NV_COMM_P(y)) {
    int ranks = 1;
    MPI_Comm_rank(comm_, &rank_);
    MPI_Comm_size(comm_, &ranks);
    const int own = static_cast<int>(NV_LOCLENGTH_P(y));
    counts_.resize(static_cast<std::size_t>(ranks));
    MPI_Allgather(&own, 1, MPI_INT, counts_.data(), 1, MPI_INT, comm_);
    for (const int count : counts_) {
      starts_.push_back(size_);
      size_ += count;
    }
    if (rank_ == 0) all_.resize(static_cast<std::size_t>(size_));
    mumps_.par = 1;  // the first rank works, too
    mumps_.sym = 0;
    mumps_.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(comm_));
    call(-1);
    for (const int output : {1, 2, 3, 4}) control(output) = 0;
    control(18) = 3;  // each rank gives its entries
  }
  ~Mumps() { call(-2); }
  Mumps(const Mumps&) = delete;
  Mumps& operator=(const Mumps&) = delete;

  /// 0, 1 where J is singular, -1 where MUMPS cannot go on; the same on all ranks.
  int factor(RankEntries& given) {
    int known = analysed_ && given.rows == rows_ && given.columns == columns_ ? 1 : 0;
    MPI_Allreduce(MPI_IN_PLACE, &known, 1, MPI_INT, MPI_MIN, comm_);
    rows_ = given.rows;
    columns_ = given.columns;
    mumps_.n = static_cast<MUMPS_INT>(size_);
    mumps_.nnz_loc = static_cast<MUMPS_INT8>(rows_.size());
    mumps_.irn_loc = rows_.data();
    mumps_.jcn_loc = columns_.data();
    mumps_.a_loc = given.values.data();
    analysed_ = known == 1 || call(1) >= 0;
    if (!analysed_) return -1;
    // More pivots than foreseen were put off: more space.
    constexpr int kMostSpace = 1000;  // per cent
    while (call(2) == -8 || mumps_.infog[0] == -9) {
      if (control(14) > kMostSpace) return -1;
      control(14) = 2 * control(14) + 20;
    }
    constexpr int kSingular = -10, kSingularStructure = -6;
    if (mumps_.infog[0] == kSingular || mumps_.infog[0] == kSingularStructure) return 1;
    return mumps_.infog[0] < 0 ? -1 : 0;
  }

  int solve(N_Vector x, N_Vector b) {
    const int own = counts_[static_cast<std::size_t>(rank_)];
    MPI_Gatherv(NV_DATA_P(b), own, MPI_DOUBLE, all_.data(), counts_.data(), starts_.data(),
                MPI_DOUBLE, 0, comm_);
    mumps_.rhs = all_.data();
    const int status = call(3);
    MPI_Scatterv(all_.data(), counts_.data(), starts_.data(), MPI_DOUBLE, NV_DATA_P(x), own,
                 MPI_DOUBLE, 0, comm_);
    return status < 0 ? -1 : 0;
  }

 private:
  int call(int job) {
    mumps_.job = job;
    dmumps_c(&mumps_);
    return mumps_.infog[0];
  }
  MUMPS_INT& control(int number) { return mumps_.icntl[number - 1]; }

  MPI_Comm comm_;
  int rank_ = 0, size_ = 0;
  std::vector<int> counts_, starts_;  // unknowns of each rank
  std::vector<int> rows_, columns_;   // of the last analysis
  std::vector<double> all_;
  bool analysed_ = false;
  DMUMPS_STRUC_C mumps_ = {};
};

Mumps& of(SUNLinearSolver solver) { return *static_cast<Mumps*>(solver->content); }

SUNLinearSolver_Type solver_type(SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; }
SUNLinearSolver_ID solver_id(SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; }
int set_up(SUNLinearSolver solver, SUNMatrix matrix) {
  return of(solver).factor(entries_of(matrix));
}
int solve(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
  return of(solver).solve(x, b);
}
int release(SUNLinearSolver solver) {
  delete &of(solver);
  SUNLinSolFreeEmpty(solver);
  return 0;
}

}  // namespace

RankEntries& entries_of(SUNMatrix matrix) { return *static_cast<RankEntries*>(matrix->content); }

SUNMatrix new_rank_matrix(SUNContext context) {
  SUNMatrix matrix = SUNMatNewEmpty(context);
  matrix->ops->getid = matrix_id;
  matrix->ops->zero = zero;
  matrix->ops->destroy = destroy;
  matrix->content = new RankEntries;
  return matrix;
}

SUNLinearSolver new_mumps_solver(N_Vector y, SUNContext context) {
  SUNLinearSolver solver = SUNLinSolNewEmpty(context);
  solver->ops->gettype = solver_type;
  solver->ops->getid = solver_id;
  solver->ops->setup = set_up;
  solver->ops->solve = solve;
  solver->ops->free = release;
  solver->content = new Mumps(y);
  return solver;
}
