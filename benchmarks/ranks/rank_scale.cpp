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

#include "shares.hpp"

int main(int argc, char** argv) {
  using namespace tether::contact_mpi;
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
  tether::contact::random::Packing p = tether::contact::random::packing(side, true, 1);
  sort_contacts(p);
  std::vector<int> owner(p.bodies.size());
  for (std::size_t b = 0; b < owner.size(); ++b)
    owner[b] = static_cast<int>(b * static_cast<std::size_t>(ranks) / owner.size());
  const Shares mine = share_of(p, owner, rank);
  const std::array<int, 2> sweeps = {20, 220};
  std::array<double, 2> least = {1e9, 1e9};
  Solution s;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < 2; ++k) {
      Options o;
      o.tolerance = 1e-300;
      o.max_assembled = 0;
      o.max_sweeps = sweeps[k];
      Solver solver(MPI_COMM_WORLD, o);
      MPI_Barrier(MPI_COMM_WORLD);
      const double begin = MPI_Wtime();
      solver.solve(mine.share, s);
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
        s.traffic.messages / s.sweeps, s.traffic.bytes / s.sweeps);
  MPI_Finalize();
  return 0;
}
