// Tether: constraints as gradients on vectors that are spread over MPI ranks.
// SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n 2 gradients_mpi: pendulums of several lengths, some on each rank, with three rows that
// hold sums over all of them. The same run with everything on one rank is the oracle. MPI_Allreduce
// is counted through the profiling interface: what the projection adds to a step of IDA.
#include <ida/ida.h>
#include <mpi.h>
#include <nvector/nvector_parallel.h>
#include <sunlinsol/sunlinsol_spgmr.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <tether/ida_projection.hpp>
#include <vector>

namespace tp = tether::ida_projection;

namespace {

long reductions = 0;
constexpr int kPendulums = 24;
constexpr double kGravity = 9.81, kEnd = 3.0;

/// Pendulums first .. last - 1 of all; x, y, u, v of each.
struct Share {
  MPI_Comm comm = MPI_COMM_SELF;
  int first = 0, last = kPendulums;
  int count() const { return last - first; }
};

double length(int pendulum) { return 0.5 + 0.05 * pendulum; }

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const Share& share = *static_cast<Share*>(data);
  const double *s = NV_DATA_P(y), *d = NV_DATA_P(yp);
  double* out = NV_DATA_P(r);
  for (int k = 0; k < share.count(); ++k, s += 4, d += 4, out += 4) {
    const double L = length(share.first + k);
    const double tension = (s[2] * s[2] + s[3] * s[3] - kGravity * s[1]) / (L * L);
    out[0] = d[0] - s[2];
    out[1] = d[1] - s[3];
    out[2] = d[2] + tension * s[0];
    out[3] = d[3] + tension * s[1] + kGravity;
  }
  return 0;
}

/// Sums of the energies, of the squared lengths and of their rates.
std::array<double, 3> sums(const Share& share, N_Vector y) {
  std::array<double, 3> own{}, all{};
  const double* s = NV_DATA_P(y);
  for (int k = 0; k < share.count(); ++k, s += 4) {
    own[0] += 0.5 * (s[2] * s[2] + s[3] * s[3]) + kGravity * s[1];
    own[1] += 0.5 * (s[0] * s[0] + s[1] * s[1]);
    own[2] += s[0] * s[2] + s[1] * s[3];
  }
  MPI_Allreduce(own.data(), all.data(), 3, MPI_DOUBLE, MPI_SUM, share.comm);
  return all;
}

tp::Constraints rows_of(const Share& share, const std::array<double, 3>& start) {
  tp::Constraints rows;
  rows.count = 3;
  rows.names = {"energy", "lengths", "rates"};
  tp::Gradients gradients;
  gradients.value = [share, start](double, N_Vector y, double* g) {
    const std::array<double, 3> now = sums(share, y);
    for (std::size_t i = 0; i < 3; ++i) g[i] = now[i] - start[i];
    return 0;
  };
  gradients.fill = [share](double, N_Vector y, N_Vector* C) {
    const double* s = NV_DATA_P(y);
    double *energy = NV_DATA_P(C[0]), *lengths = NV_DATA_P(C[1]), *rates = NV_DATA_P(C[2]);
    for (int k = 0; k < 4 * share.count(); k += 4) {
      energy[k + 1] = kGravity;
      for (int i = 0; i < 2; ++i) {
        energy[k + 2 + i] = s[k + 2 + i];
        lengths[k + i] = s[k + i];
        rates[k + i] = s[k + 2 + i];
        rates[k + 2 + i] = s[k + i];
      }
    }
    return 0;
  };
  rows.jacobian = gradients;
  return rows;
}

struct End {
  std::vector<double> own;  // the share of this rank
  double drift = 0, reductions_per_step = 0;
  int flag = 0;
};

End run(Share share, bool project) {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  SUNContext_Create(share.comm, &context);
#else
  SUNContext_Create(&share.comm, &context);
#endif
  const int n = 4 * share.count();
  N_Vector y = N_VNew_Parallel(share.comm, n, 4 * kPendulums, context), yp = N_VClone(y);
  for (int k = 0; k < share.count(); ++k) {
    const double L = length(share.first + k), angle = 0.3 + 0.07 * (share.first + k);
    double* s = NV_DATA_P(y) + 4 * k;
    s[0] = L * std::sin(angle);
    s[1] = -L * std::cos(angle);
    s[2] = s[3] = 0;
  }
  N_VConst(0.0, yp);
  residual(0, y, yp, yp, &share);  // f with y' = 0 is -y'
  N_VScale(-1.0, yp, yp);
  const std::array<double, 3> start = sums(share, y);

  void* ida = IDACreate(context);
  IDAInit(ida, residual, 0.0, y, yp);
  IDASStolerances(ida, 1e-7, 1e-8);
  IDASetUserData(ida, &share);
  IDASetMaxNumSteps(ida, 100000);
  SUNLinearSolver solver = SUNLinSol_SPGMR(y, SUN_PREC_NONE, 20, context);
  IDASetLinearSolver(ida, solver, nullptr);
  End end;
  {
    std::unique_ptr<tp::Projection> projection;
    if (project) projection = std::make_unique<tp::Projection>(ida, rows_of(share, start));
    double t = 0;
    reductions = 0;
    end.flag = IDASolve(ida, kEnd, &t, y, yp, IDA_NORMAL);
    long steps = 1;
    IDAGetNumSteps(ida, &steps);
    end.reductions_per_step = static_cast<double>(reductions) / static_cast<double>(steps);
    if (projection) projection->project(t, y, yp);
    end.own.assign(NV_DATA_P(y), NV_DATA_P(y) + n);
    const std::array<double, 3> now = sums(share, y);
    for (std::size_t i = 0; i < 3; ++i)
      end.drift = std::max(end.drift, std::abs(now[i] - start[i]));
    IDAFree(&ida);
  }
  SUNLinSolFree(solver);
  N_VDestroy(yp);
  N_VDestroy(y);
  SUNContext_Free(&context);
  return end;
}

}  // namespace

extern "C" int MPI_Allreduce(const void* from, void* to, int count, MPI_Datatype type, MPI_Op op,
                             MPI_Comm comm) {
  ++reductions;
  return PMPI_Allreduce(from, to, count, type, op, comm);
}

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  Share share;
  int rank = 0, ranks = 1;
  share.comm = MPI_COMM_WORLD;
  MPI_Comm_rank(share.comm, &rank);
  MPI_Comm_size(share.comm, &ranks);
  share.first = kPendulums * rank / ranks;
  share.last = kPendulums * (rank + 1) / ranks;

  const End alone = run(Share{}, true), plain = run(share, false), spread = run(share, true);
  double apart = 0;
  for (std::size_t i = 0; i < spread.own.size(); ++i)
    apart = std::max(
        apart, std::abs(spread.own[i] - alone.own[4 * static_cast<std::size_t>(share.first) + i]));
  double worst = 0;
  PMPI_Allreduce(&apart, &worst, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
  // Sums in another order differ in their last bits, which the step-size controller magnifies to
  // about a tolerance.
  const bool good = alone.flag >= 0 && spread.flag >= 0 && worst < 1e-5 && spread.drift < 1e-10;
  const double added = spread.reductions_per_step - plain.reductions_per_step;
  if (rank == 0)
    std::printf(
        "%d ranks: %.1e from the run on one, rows %.1e (plain IDA %.1e), reductions a step: plain "
        "%.1f, "
        "the projection adds %.1f\n",
        ranks, worst, spread.drift, plain.drift, plain.reductions_per_step, added);
  MPI_Finalize();
  return good && added < 40 ? 0 : 1;
}
