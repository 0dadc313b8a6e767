// Uses the installed tether::contact_mpi on one rank. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact_mpi.hpp>

bool use_contact_mpi() {
  // A ball falls onto the world.
  std::vector<tether::contact::RigidBody> bodies(1);
  bodies[0].inverse_mass = 1;
  bodies[0].velocity = {0, 0, -1};
  const std::vector<tether::contact::PointContact> contacts(1);
  MPI_Init(nullptr, nullptr);
  double speed = 1;
  {
    tether::contact_mpi::Messages messages(MPI_COMM_WORLD);
    tether::contact::RankTeam team(messages);
    tether::contact::BodyOptions options;
    options.team = &team;
    speed = tether::contact::BodySolver(options).solve(bodies, contacts).velocities[0].norm();
  }
  MPI_Finalize();
  return speed < 1e-12;
}
