// Tether: a sweep over MPI ranks by the clock. SPDX-License-Identifier: BSD-3-Clause
//
//   mpirun -n RANKS rank_scale [side of the lattice = 33] [rounds = 5]
//
// The same lattice of spheres for any number of ranks, in slabs. Time of a sweep: from the
// difference of 20 and 220 sweeps, the least of the rounds, so that the plan, bodies on their way
// and results cancel.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <tether/contact_mpi.hpp>

#include "packing.hpp"

int main(int argc, char** argv) {
  using namespace tether::contact;
  using tether::contact_mpi::Messages;
  MPI_Init(&argc, &argv);
  int ranks = 1, rank = 0;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  const int side = argc > 1 ? std::atoi(argv[1]) : 33, rounds = argc > 2 ? std::atoi(argv[2]) : 5;
  if (side < 2 || side > 200 || rounds < 1) {
    if (rank == 0) std::fprintf(stderr, "rank_scale [side 2 .. 200] [rounds >= 1]\n");
    MPI_Finalize();
    return 2;
  }
  const tether::contact::random::Packing p = tether::contact::random::packing(side, true, 1);
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t b = 0; b < p.bodies.size(); ++b)
    positions.emplace_back(static_cast<double>(b), 0, 0);
  const std::array<int, 2> sweeps = {20, 220};
  std::array<double, 2> least = {1e9, 1e9};
  BodySolution s;
  Messages messages(MPI_COMM_WORLD);
  RankTeam team(messages);
  team.place(positions);
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < 2; ++k) {
      BodyOptions o;
      o.tolerance = 1e-300;
      o.max_assembled = 0;
      o.max_sweeps = sweeps[k];
      o.team = &team;
      BodySolver solver(o);
      messages.traffic = {};
      MPI_Barrier(MPI_COMM_WORLD);
      const double begin = MPI_Wtime();
      solver.solve(p.bodies, p.contacts, s);
      MPI_Barrier(MPI_COMM_WORLD);
      least[k] = std::min(least[k], MPI_Wtime() - begin);
    }
  }
  const double sweep = (least[1] - least[0]) / (sweeps[1] - sweeps[0]);
  if (rank == 0)
    std::printf(
        "%d ranks, %zu contacts: %.1f us a sweep, %.1f ns a contact; rank 0 sends %lld messages, "
        "%lld bytes\n",
        ranks, p.contacts.size(), 1e6 * sweep, 1e9 * sweep / static_cast<double>(p.contacts.size()),
        messages.traffic.messages / s.sweeps, messages.traffic.bytes / s.sweeps);
  MPI_Finalize();
  return 0;
}
