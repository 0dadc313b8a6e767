// Tether: a heap of spheres over MPI ranks, the same bits for any number of them.
// SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n 4 example_ranks_heap --spheres 10000 --steps 500
//
// Spheres fall into a box. Every rank has them all and finds all contacts; they share the solves.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <tether/contact/stepping.hpp>
#include <tether/contact_mpi.hpp>

namespace tc = tether::contact;
using Eigen::Vector3d;

namespace {

constexpr double kRadius = 0.05;  // m

struct Settings {
  int spheres = 10000, steps = 500;
};

Settings settings(int argc, char** argv) {
  Settings s;
  for (int k = 1; k < argc; k += 2) {
    const std::string word = argv[k];
    if (word != "--spheres" && word != "--steps")
      throw std::invalid_argument(word + ": there are --spheres, --steps");
    if (k + 1 == argc) throw std::invalid_argument(word + " needs a value");
    (word == "--spheres" ? s.spheres : s.steps) = std::stoi(argv[k + 1]);
  }
  if (s.spheres < 1) throw std::invalid_argument("--spheres must be >= 1");
  return s;
}

// A loose lattice, pushed out of order, above the floor of a box without a lid.
tc::Stepper heap(int spheres, tc::RankTeam& team) {
  const int side = std::max(2, static_cast<int>(std::cbrt(spheres / 2.0)));
  const double width = 2.4 * kRadius * side;
  tc::BodySet bodies;
  std::vector<tc::Surface> shapes;
  for (const Vector3d& inwards : {Vector3d(0, 0, 1), Vector3d(1, 0, 0), Vector3d(0, 1, 0),
                                  Vector3d(-1, 0, 0), Vector3d(0, -1, 0)}) {
    const int wall = bodies.add_fixed(width * (-inwards).cwiseMax(0.0));
    shapes.push_back({wall, tc::Shape::plane(inwards), 0});
  }
  for (int k = 0; k < spheres; ++k) {
    const Vector3d place(k % side, k / side % side, k / side / side);
    const Vector3d off(std::sin(12.9898 * k), std::sin(78.233 * k), std::sin(37.719 * k));
    const int body = bodies.add(1, 0.4 * kRadius * kRadius * Eigen::Matrix3d::Identity(),
                                kRadius * (2.4 * place + Vector3d::Constant(1.2) + 0.15 * off));
    shapes.push_back({body, tc::Shape::sphere(kRadius), 0});
  }
  tc::SteppingOptions options;
  options.step = 5e-3;
  options.gravity = Vector3d(0, 0, -9.81);
  options.tolerance = 1e-4;
  options.max_sweeps = 60;
  options.acceptance = 1e2;
  options.cut_at_impacts = false;
  options.team = &team;
  return tc::Stepper(bodies, shapes, {{0, 0, 0.4, 0}}, options);
}

// Hash of all positions and velocities.
unsigned long long hash(const tc::BodySet& bodies) {
  unsigned long long h = 14695981039346656037u;
  for (std::size_t i = 0; i < bodies.position.size(); ++i)
    for (const Vector3d& v :
         {bodies.position[i], bodies.motion[i].velocity, bodies.motion[i].angular_velocity}) {
      unsigned char bytes[24];
      std::memcpy(bytes, v.data(), 24);
      for (unsigned char byte : bytes) h = (h ^ byte) * 1099511628211u;
    }
  return h;
}

void run(int argc, char** argv) {
  const Settings s = settings(argc, argv);
  tether::contact_mpi::Messages messages(MPI_COMM_WORLD);
  tc::RankTeam team(messages);
  tc::Stepper stepper = heap(s.spheres, team);
  for (int k = 1; k <= s.steps; ++k) {
    stepper.step();
    if (messages.rank() != 0 || k % std::max(1, s.steps / 5) != 0) continue;
    std::printf("step %4d: residual %.1e; this rank: %ld contacts swept, %lld messages\n", k,
                stepper.residual(), team.swept_contacts(), messages.traffic.messages);
  }
  if (messages.rank() == 0)
    std::printf("state after %d steps: %016llx\n", s.steps, hash(stepper.bodies()));
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int result = 0, rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  try {
    run(argc, argv);
  } catch (const std::exception& e) {
    if (rank == 0) std::fprintf(stderr, "example_ranks_heap: %s\n", e.what());  // the same on all
    result = 1;
  }
  MPI_Finalize();
  return result;
}
