// Uses the installed tether::contact_mpi on one rank. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/contact_mpi.hpp>

bool use_contact_mpi() {
  // A ball falls onto the world.
  tether::contact_mpi::Share share;
  share.numbers = {0};
  share.bodies.resize(1);
  share.bodies[0].inverse_mass = 1;
  share.bodies[0].velocity = {0, 0, -1};
  share.contacts.resize(1);
  MPI_Init(nullptr, nullptr);
  const std::vector<int> to = tether::contact_mpi::partition(MPI_COMM_WORLD, {0}, {{0, 0, 0}}, {1});
  double speed = 1;
  {
    tether::contact_mpi::Solver solver(MPI_COMM_WORLD);
    speed = solver.solve(share).velocities[0].norm();
  }
  MPI_Finalize();
  return speed < 1e-12 && to[0] == 0;
}
