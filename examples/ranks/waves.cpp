// Tether: waves over MPI ranks whose mass and energy stay. SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n 4 example_ranks_waves [end time, 20]
//
// The regularised long-wave equation of Benjamin, Bona and Mahony (1972) on a ring,
//
//   u_t - u_xxt + u_x + u u_x = 0,   mass: sum of u,   energy: sum of (u^2 + u_x^2) / 2,
//
// by central differences with u u_x = (u u_x + (u^2)_x) / 3, which keep both sums; IDA does not.
// Two rows of the projection hold sums over all ranks, by gradients that lie on the ranks as u
// does. The run with all points on one rank is what the others are compared with.
#include <ida/ida.h>
#include <mpi.h>
#include <nvector/nvector_parallel.h>
#include <sunlinsol/sunlinsol_spgmr.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <tether/ida_projection.hpp>
#include <vector>

namespace tp = tether::ida_projection;

namespace {

constexpr int kPoints = 400;
constexpr double kLength = 100, kSpacing = kLength / kPoints, kTolerance = 1e-6;
constexpr double kSpeed = 1.5;  // of the solitary wave

// A part of the ring, with the points beside it.
struct Part {
  MPI_Comm comm = MPI_COMM_SELF;
  int first = 0, points = kPoints;
  int left = 0, right = 0;  // ranks

  explicit Part(MPI_Comm c) : comm(c) {
    int rank = 0, ranks = 1;
    MPI_Comm_rank(c, &rank);
    MPI_Comm_size(c, &ranks);
    first = kPoints * rank / ranks;
    points = kPoints * (rank + 1) / ranks - first;
    left = (rank + ranks - 1) % ranks;
    right = (rank + 1) % ranks;
  }
  // u[-1] .. u[points]
  std::vector<double> with_neighbours(N_Vector v) const {
    const double* u = NV_DATA_P(v);
    std::vector<double> out(static_cast<std::size_t>(points) + 2);
    std::copy(u, u + points, out.begin() + 1);
    MPI_Sendrecv(u, 1, MPI_DOUBLE, left, 1, &out.back(), 1, MPI_DOUBLE, right, 1, comm,
                 MPI_STATUS_IGNORE);
    MPI_Sendrecv(u + points - 1, 1, MPI_DOUBLE, right, 2, out.data(), 1, MPI_DOUBLE, left, 2, comm,
                 MPI_STATUS_IGNORE);
    return out;
  }
};

double second_difference(const double* u) {
  return (u[-1] - 2 * u[0] + u[1]) / (kSpacing * kSpacing);
}

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const Part& part = *static_cast<Part*>(data);
  const std::vector<double> values = part.with_neighbours(y), rates = part.with_neighbours(yp);
  for (int k = 0; k < part.points; ++k) {
    const double *u = values.data() + k + 1, *v = rates.data() + k + 1;
    const double slope = (u[1] - u[-1]) / (2 * kSpacing);
    const double of_square = (u[1] * u[1] - u[-1] * u[-1]) / (2 * kSpacing);
    NV_DATA_P(r)[k] = v[0] - second_difference(v) + slope + (u[0] * slope + of_square) / 3;
  }
  return 0;
}

// Mass and energy.
std::array<double, 2> sums(const Part& part, N_Vector y) {
  const std::vector<double> values = part.with_neighbours(y);
  std::array<double, 2> own{}, all{};
  for (int k = 0; k < part.points; ++k) {
    const double* u = values.data() + k + 1;
    const double slope = (u[1] - u[0]) / kSpacing;
    own[0] += kSpacing * u[0];
    own[1] += 0.5 * kSpacing * (u[0] * u[0] + slope * slope);
  }
  MPI_Allreduce(own.data(), all.data(), 2, MPI_DOUBLE, MPI_SUM, part.comm);
  return all;
}

tp::Constraints rows(const Part& part, const std::array<double, 2>& start) {
  tp::Constraints out;
  out.count = 2;
  out.names = {"mass", "energy"};
  tp::Gradients gradients;
  gradients.value = [part, start](double, N_Vector y, double* g) {
    const std::array<double, 2> now = sums(part, y);
    for (std::size_t i = 0; i < 2; ++i) g[i] = now[i] - start[i];
    return 0;
  };
  gradients.fill = [part](double, N_Vector y, N_Vector* C) {
    const std::vector<double> values = part.with_neighbours(y);
    N_VConst(kSpacing, C[0]);
    for (int k = 0; k < part.points; ++k) {
      const double* u = values.data() + k + 1;
      NV_DATA_P(C[1])[k] = kSpacing * (u[0] - second_difference(u));
    }
    return 0;
  };
  out.jacobian = gradients;
  return out;
}

double solitary_wave(double x, double t) {
  double from_crest = std::remainder(x - 0.3 * kLength - kSpeed * t, kLength);
  const double c = std::cosh(0.5 * std::sqrt((kSpeed - 1) / kSpeed) * from_crest);
  return 3 * (kSpeed - 1) / (c * c);
}

struct End {
  std::vector<double> own;  // u of this part
  double drift = 0, error = 0;
  long steps = 0;
  int flag = 0;
};

End run(Part part, bool project, double seconds) {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  SUNContext_Create(part.comm, &context);
#else
  SUNContext_Create(&part.comm, &context);
#endif
  N_Vector y = N_VNew_Parallel(part.comm, part.points, kPoints, context);
  N_VEnableFusedOps_Parallel(y, 1);
  N_Vector yp = N_VClone(y);
  for (int k = 0; k < part.points; ++k) {
    const double x = kSpacing * (part.first + k), step = 1e-4;
    NV_DATA_P(y)[k] = solitary_wave(x, 0);
    NV_DATA_P(yp)[k] = (solitary_wave(x, step) - solitary_wave(x, -step)) / (2 * step);
  }
  const std::array<double, 2> start = sums(part, y);
  void* ida = IDACreate(context);
  IDAInit(ida, residual, 0.0, y, yp);
  IDASStolerances(ida, kTolerance, kTolerance);
  IDASetUserData(ida, &part);
  IDASetMaxNumSteps(ida, 100000);
  // One message for all scalar products of an iteration, not one for each.
  SUNLinearSolver solver = SUNLinSol_SPGMR(y, SUN_PREC_NONE, 40, context);
  SUNLinSol_SPGMRSetGSType(solver, SUN_CLASSICAL_GS);
  IDASetLinearSolver(ida, solver, nullptr);
  End end;
  {
    std::unique_ptr<tp::Projection> projection;
    if (project) projection = std::make_unique<tp::Projection>(ida, rows(part, start));
    double t = 0;
    end.flag = IDASolve(ida, seconds, &t, y, yp, IDA_NORMAL);
    if (projection) projection->project(t, y, yp);
    IDAGetNumSteps(ida, &end.steps);
    IDAFree(&ida);
  }
  end.own.assign(NV_DATA_P(y), NV_DATA_P(y) + part.points);
  const std::array<double, 2> now = sums(part, y);
  for (std::size_t i = 0; i < 2; ++i)
    end.drift = std::max(end.drift, std::abs(now[i] / start[i] - 1));
  for (int k = 0; k < part.points; ++k) {
    const double exact = solitary_wave(kSpacing * (part.first + k), seconds);
    end.error = std::max(end.error, std::abs(end.own[static_cast<std::size_t>(k)] - exact));
  }
  MPI_Allreduce(MPI_IN_PLACE, &end.error, 1, MPI_DOUBLE, MPI_MAX, part.comm);
  SUNLinSolFree(solver);
  N_VDestroy(yp);
  N_VDestroy(y);
  SUNContext_Free(&context);
  return end;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  const Part all(MPI_COMM_SELF), mine(MPI_COMM_WORLD);
  const double seconds = argc > 1 ? std::atof(argv[1]) : 20.0;
  if (argc > 2 || !(seconds > 0.0 && seconds <= 1000.0)) {
    if (mine.first == 0)
      std::fprintf(stderr, "usage: example_ranks_waves [end time, above 0, at most 1000]\n");
    MPI_Finalize();
    return 2;
  }
  const End alone = run(all, true, seconds), plain = run(mine, false, seconds),
            spread = run(mine, true, seconds);
  double apart = 0;
  for (int k = 0; k < mine.points; ++k) {
    const auto own = static_cast<std::size_t>(k), same = static_cast<std::size_t>(mine.first + k);
    apart = std::max(apart, std::abs(spread.own[own] - alone.own[same]));
  }
  MPI_Allreduce(MPI_IN_PLACE, &apart, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (mine.first == 0) {
    std::printf("%d ranks     steps   drift of mass, energy   end error\n", ranks);
    std::printf("plain IDA   %5ld   %21.1e   %9.3e\n", plain.steps, plain.drift, plain.error);
    std::printf("projected   %5ld   %21.1e   %9.3e\n", spread.steps, spread.drift, spread.error);
    std::printf("one rank    %5ld   %21.1e   %9.3e   apart %.1e\n", alone.steps, alone.drift,
                alone.error, apart);
  }
  MPI_Finalize();
  // Sums in another order differ in their last bits, and with them where GMRES ends.
  const bool good = alone.flag >= 0 && plain.flag >= 0 && spread.flag >= 0 &&
                    spread.steps == alone.steps && spread.drift < 1e-13 && apart < 0.1 * kTolerance;
  return good ? 0 : 1;
}
