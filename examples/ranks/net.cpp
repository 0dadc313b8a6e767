// Tether: a net of rods over MPI ranks that keep their lengths. SPDX-License-Identifier:
// BSD-3-Clause
//
// mpiexec -n 4 example_ranks_net [balls in a row [seconds]]
//
// The model is that of net_model.hpp. IDA lets the lengths of rods drift; DistributedRows hold
// them and their rates. GMRES solves IDA's systems, preconditioned by each rank's own block, or,
// where it was found, MUMPS.
#include <ida/ida.h>
#include <mpi.h>
#include <nvector/nvector_parallel.h>
#include <sunlinsol/sunlinsol_spgmr.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <tether/ida_projection.hpp>
#include <utility>
#include <vector>

#include "net_model.hpp"
#ifdef TETHER_EXAMPLE_MUMPS
#include "mumps_solver.hpp"
#endif

using namespace net;
namespace tp = tether::ida_projection;

namespace {

constexpr double kTolerance = 1e-6;

Model& model_of(void* data) { return *static_cast<Model*>(data); }

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  model_of(data).residual(NV_DATA_P(y), NV_DATA_P(yp), NV_DATA_P(r));
  return 0;
}
int set_up(sunrealtype, N_Vector y, N_Vector yp, N_Vector, sunrealtype cj, void* data) {
  return model_of(data).factor(NV_DATA_P(y), NV_DATA_P(yp), cj) ? 0 : 1;
}
int precondition(sunrealtype, N_Vector, N_Vector, N_Vector, N_Vector r, N_Vector z, sunrealtype,
                 sunrealtype, void* data) {
  const Model& model = model_of(data);
  Eigen::Map<Eigen::VectorXd>(NV_DATA_P(z), model.share.unknowns()) =
      model.factors.solve(Eigen::Map<const Eigen::VectorXd>(NV_DATA_P(r), model.share.unknowns()));
  return 0;
}

#ifdef TETHER_EXAMPLE_MUMPS
int fill(sunrealtype, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix matrix,
         void* data, N_Vector, N_Vector, N_Vector) {
  RankEntries& entries = entries_of(matrix);
  model_of(data).jacobian(
      NV_DATA_P(y), NV_DATA_P(yp), cj,
      [&](long long row, long long column, double entry) { entries.add(row, column, entry); });
  return 0;
}
#endif

enum class Solver { gmres, mumps };

// IDA's linear solver, and its matrix if it has one.
struct LinearSolver {
  SUNLinearSolver solver = nullptr;
  SUNMatrix matrix = nullptr;

  LinearSolver(Solver which, void* ida, N_Vector y, SUNContext context) {
#ifdef TETHER_EXAMPLE_MUMPS
    if (which == Solver::mumps) {
      matrix = new_rank_matrix(context);
      solver = new_mumps_solver(y, context);
      IDASetLinearSolver(ida, solver, matrix);
      IDASetJacFn(ida, fill);
      return;
    }
#endif
    (void)which;
    // One message for all scalar products of an iteration, not one for each.
    solver = SUNLinSol_SPGMR(y, SUN_PREC_LEFT, 60, context);
    SUNLinSol_SPGMRSetGSType(solver, SUN_CLASSICAL_GS);
    IDASetLinearSolver(ida, solver, nullptr);
    IDASetPreconditioner(ida, set_up, precondition);
    IDASetEpsLin(ida, 0.01);
  }
  void free() {
    SUNLinSolFree(solver);
    if (matrix != nullptr) SUNMatDestroy(matrix);
  }
};

struct End {
  std::vector<double> own;
  double drift = 0.0, seconds = 0.0, projecting = 0.0;
  long steps = 0;
  int flag = 0;
};

End run(MPI_Comm comm, int n, double seconds, bool project, Solver which = Solver::gmres) {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  SUNContext_Create(comm, &context);
#else
  SUNContext_Create(&comm, &context);
#endif
  Model model{Share(comm, n)};
  const Share& share = model.share;
  N_Vector y = N_VNew_Parallel(comm, share.unknowns(), kPerBall * n * n, context);
  N_VEnableFusedOps_Parallel(y, 1);
  N_Vector yp = N_VClone(y), id = N_VClone(y);
  N_VConst(0.0, y);
  N_VConst(0.0, yp);
  N_VConst(1.0, id);
  model.balls([&](int row, int column) {
    const Point p = start_of(row, column);
    const int at = share.local(row, column, 0);
    std::copy(p.begin(), p.end(), NV_DATA_P(y) + at);
    NV_DATA_P(yp)[at + 5] = -kGravity;
    NV_DATA_P(id)[at + 6] = NV_DATA_P(id)[at + 7] = 0.0;
  });
  void* ida = IDACreate(context);
  IDAInit(ida, residual, 0.0, y, yp);
  IDASStolerances(ida, kTolerance, kTolerance);
  IDASetUserData(ida, &model);
  IDASetMaxNumSteps(ida, 100000);
  IDASetId(ida, id);
  IDASetSuppressAlg(ida, 1);
  LinearSolver linear(which, ida, y, context);
  End end;
  {
    tp::Options options;
    options.id = id;
    std::unique_ptr<tp::Projection> projection;
    if (project) projection = std::make_unique<tp::Projection>(ida, model.rows(), options);
    end.flag = IDACalcIC(ida, IDA_YA_YDP_INIT, 1e-3);
    double t = 0.0;
    const double begin = MPI_Wtime();
    if (end.flag >= 0) end.flag = IDASolve(ida, seconds, &t, y, yp, IDA_NORMAL);
    end.seconds = MPI_Wtime() - begin;
    if (projection) {
      end.projecting = projection->statistics().seconds;
      projection->project(t, y, yp);
    }
    IDAGetNumSteps(ida, &end.steps);
    IDAFree(&ida);
  }
  end.own.assign(NV_DATA_P(y), NV_DATA_P(y) + share.unknowns());
  end.drift = model.drift(NV_DATA_P(y));
  linear.free();
  for (N_Vector v : {y, yp, id}) N_VDestroy(v);
  SUNContext_Free(&context);
  return end;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const int n = argc > 1 ? std::atoi(argv[1]) : 8;
  const double seconds = argc > 2 ? std::atof(argv[2]) : 0.5;
  if (argc > 3 || n < std::max(ranks, 2) || n > 1000 || !(seconds > 0.0 && seconds <= 100.0)) {
    if (rank == 0)
      std::fprintf(
          stderr,
          "usage: example_ranks_net [balls in a row, %d to 1000 on %d ranks [seconds, above "
          "0, at most 100]]\n",
          std::max(ranks, 2), ranks);
    MPI_Finalize();
    return 2;
  }
  const End plain = run(MPI_COMM_WORLD, n, seconds, false);
  const End spread = run(MPI_COMM_WORLD, n, seconds, true);
  const End alone = run(MPI_COMM_SELF, n, seconds, true);
  std::vector<std::pair<const char*, End>> others;  // projected, too
#ifdef TETHER_EXAMPLE_MUMPS
  others.emplace_back("projected, MUMPS", run(MPI_COMM_WORLD, n, seconds, true, Solver::mumps));
#endif

  const Share mine(MPI_COMM_WORLD, n);
  const auto apart = [&](const End& one) {  // its positions from those on one rank
    const auto from = static_cast<std::size_t>(mine.global(mine.first, 0, 0));
    double most = 0.0;
    for (std::size_t j = 0; j < one.own.size(); ++j)
      if (j % kPerBall < 3) most = std::max(most, std::abs(one.own[j] - alone.own[j + from]));
    MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    return most;
  };
  std::vector<double> apart_of{apart(spread)};
  bool good = plain.flag >= 0 && spread.flag >= 0 && alone.flag >= 0 && spread.drift < 1e-10;
  for (const auto& [name, end] : others) {
    apart_of.push_back(apart(end));
    good = good && end.flag >= 0 && end.drift < 1e-10;
  }
  if (rank == 0) {
    std::printf(
        "%d ranks, %d x %d balls, %.2g s   steps   lengths off by   seconds   projection's part   "
        "from one rank's positions\n",
        ranks, n, n, seconds);
    const auto print = [](const char* name, const End& end) {
      std::printf("%-29s %5ld %16.1e %9.2f %18.0f%%   flag %d", name, end.steps, end.drift,
                  end.seconds, 100.0 * end.projecting / end.seconds, end.flag);
    };
    print("plain IDA", plain);
    std::printf("\n");
    print("projected, one rank", alone);
    std::printf("\n");
    print("projected", spread);
    std::printf("   %.1e m\n", apart_of.front());
    for (std::size_t k = 0; k < others.size(); ++k) {
      print(others[k].first, others[k].second);
      std::printf("   %.1e m\n", apart_of[k + 1]);
    }
  }
  MPI_Finalize();
  return good && *std::max_element(apart_of.begin(), apart_of.end()) < 1e2 * kTolerance ? 0 : 1;
}
