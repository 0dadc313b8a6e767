// Tether: contacts over MPI ranks against one process. SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n N ranks [side of the packings]
#include <array>
#include <cmath>
#include <cstring>
#include <tether/contact_mpi.hpp>

#include "check.hpp"
#include "packing.hpp"

namespace {

using namespace tether::contact_mpi;
using tether::contact::BodySolution;
using tether::contact::BodySolver;
using Options = tether::contact::BodyOptions;
using tether::contact::Law;
using tether::contact::PointContact;
using tether::contact::RankTeam;
using tether::contact::Status;
using tether::contact::random::Generator;
using tether::contact::random::Packing;

int ranks = 1, rank = 0;

// A lattice of spheres and bodies of any shape, contacts with and without friction, many of them
// with the floor: a body of its own with a velocity.
Packing mixed(int side, std::uint64_t seed) {
  const Packing round = tether::contact::random::packing(side, true, seed);
  Packing p = tether::contact::random::packing(side, false, seed);
  const int floor = static_cast<int>(p.bodies.size());
  p.bodies.push_back({});
  p.bodies.back().velocity = {0.02, 0, 0};
  Generator g(seed);
  for (std::size_t i = 0; i < p.contacts.size(); ++i) {
    PointContact& c = p.contacts[i];
    const auto is_round = [](int b) { return b < 0 || b % 3 != 0; };
    if (is_round(c.first) && is_round(c.second)) c = round.contacts[i];
    if (g.uniform(0, 1) < 0.1) c.mu = 0;
    if (c.second < 0) c.second = floor;
    c.id = i;
  }
  for (std::size_t b = 0; b < round.bodies.size(); ++b)
    if (b % 3 != 0) p.bodies[b] = round.bodies[b];
  return p;
}

// Along a line, or anywhere, such that neighbours are mostly on other ranks.
std::vector<Eigen::Vector3d> in_line(std::size_t bodies) {
  std::vector<Eigen::Vector3d> out;
  for (std::size_t b = 0; b < bodies; ++b) out.emplace_back(static_cast<double>(b), 0, 0);
  return out;
}
std::vector<Eigen::Vector3d> anywhere(std::size_t bodies, std::uint64_t seed) {
  Generator g(seed);
  std::vector<Eigen::Vector3d> out(bodies);
  for (Eigen::Vector3d& x : out) x = g.vector();
  return out;
}

// All that one process finds, bit by bit.
bool same(const BodySolution& one, const BodySolution& s) {
  const auto same_bits = [](const std::vector<Eigen::Vector3d>& a,
                            const std::vector<Eigen::Vector3d>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), 24 * a.size()) == 0;
  };
  return s.status == one.status && s.error == one.error && s.sweeps == one.sweeps &&
         s.islands == one.islands && s.colours == one.colours &&
         s.assembled_islands == one.assembled_islands && s.failed_islands == one.failed_islands &&
         s.warm_started == one.warm_started && s.regimes == one.regimes &&
         same_bits(s.velocities, one.velocities) &&
         same_bits(s.angular_velocities, one.angular_velocities) &&
         same_bits(s.impulses, one.impulses);
}

void everywhere(std::vector<Eigen::Vector3d>& list, std::size_t n) {
  list.resize(n);
  MPI_Bcast(list.data(), static_cast<int>(3 * n), MPI_DOUBLE, 0, MPI_COMM_WORLD);
}

// One process, the first rank, and all know what it has found.
BodySolution alone(BodySolver& solver, const Packing& p) {
  BodySolution out;
  if (rank == 0) solver.solve(p.bodies, p.contacts, out);
  std::array<int, 7> counts = {
      static_cast<int>(out.status), out.sweeps,         out.colours,     out.islands,
      out.assembled_islands,        out.failed_islands, out.warm_started};
  MPI_Bcast(counts.data(), 7, MPI_INT, 0, MPI_COMM_WORLD);
  out.status = static_cast<Status>(counts[0]);
  out.sweeps = counts[1];
  out.colours = counts[2];
  out.islands = counts[3];
  out.assembled_islands = counts[4];
  out.failed_islands = counts[5];
  out.warm_started = counts[6];
  MPI_Bcast(&out.error, 1, MPI_DOUBLE, 0, MPI_COMM_WORLD);
  everywhere(out.impulses, p.contacts.size());
  everywhere(out.velocities, p.bodies.size());
  everywhere(out.angular_velocities, p.bodies.size());
  out.regimes.resize(p.contacts.size());
  MPI_Bcast(out.regimes.data(), static_cast<int>(sizeof(out.regimes[0]) * out.regimes.size()),
            MPI_BYTE, 0, MPI_COMM_WORLD);
  return out;
}

// The ranks as a team, with its messages.
struct Shared {
  explicit Shared(const Options& o, const std::vector<Eigen::Vector3d>& positions)
      : messages(MPI_COMM_WORLD), team(messages, 0) {
    team.place(positions);
    options = o;
    options.team = &team;
  }
  Messages messages;
  RankTeam team;
  Options options;
};

BodySolution by_all(const Packing& p, const Options& o,
                    const std::vector<Eigen::Vector3d>& positions) {
  Shared shared(o, positions);
  return BodySolver(shared.options).solve(p.bodies, p.contacts);
}

void same_bits_as_one_process(int side) {
  for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
    for (const bool near : {true, false}) {
      Options o;
      o.law = law;
      o.max_sweeps = law == Law::coulomb ? 100 : 25;
      o.max_assembled = 0;
      Packing p = mixed(side, 7);
      BodySolver one(o);
      const std::size_t n = p.bodies.size();
      Shared shared(o, near ? in_line(n) : anywhere(n, 3));
      BodySolver solver(shared.options);
      for (int solve = 0; solve < 2; ++solve) {
        shared.messages.traffic = {};
        const long before = shared.team.swept_contacts();
        const BodySolution expected = alone(one, p);
        const BodySolution s = solver.solve(p.bodies, p.contacts);
        CHECK(same(expected, s));
        CHECK(s.warm_started == (solve == 0 ? 0 : static_cast<int>(p.contacts.size())));
        for (PointContact& c : p.contacts) c.bias = 1e-3;
        if (ranks == 1) continue;
        // A problem of one island: a rank sends velocities alone, one sum ends each pass, and all
        // sweep about alike many contacts.
        CHECK(static_cast<double>(shared.team.swept_contacts() - before) * ranks <=
              1.1 * static_cast<double>(p.contacts.size()) + 400 * (ranks - 1));
        const Traffic& traffic = shared.messages.traffic;
        CHECK(traffic.messages >= s.sweeps && traffic.bytes % 48 == 0);
        CHECK(traffic.reductions > s.sweeps && traffic.reductions < 2 * s.sweeps + 6);
      }
    }
  }
}

void same_bits_with_threads(int side) {
  Options o;
  o.max_sweeps = 20;
  o.max_assembled = 0;
  const Packing p = mixed(side, 11);
  BodySolver one(o);
  const BodySolution expected = alone(one, p);
  o.threads = 2;
  CHECK(same(expected, by_all(p, o, in_line(p.bodies.size()))));
}

// Sweeps end early, and one rank goes on with all of it.
void islands_of_several_ranks_are_assembled() {
  Packing p = tether::contact::random::packing(9, true, 5);
  for (PointContact& c : p.contacts) c.mu = 0.7;
  Options o;
  o.tolerance = 1e-7;
  o.max_sweeps = 20;
  o.max_work = 1e8;
  BodySolver one(o);
  const BodySolution expected = alone(one, p);
  CHECK(expected.assembled_islands == 1);
  CHECK(same(expected, by_all(p, o, anywhere(p.bodies.size(), 1))));
}

void islands_of_one_rank_need_no_sweep_messages() {
  Packing p;
  for (int k = 0; k < 40; ++k) {
    const Packing one =
        tether::contact::random::packing(2 + k % 2, k % 3 == 0, static_cast<std::uint64_t>(k + 1));
    const int before = static_cast<int>(p.bodies.size());
    for (const auto& b : one.bodies) p.bodies.push_back(b);
    for (PointContact c : one.contacts) {
      c.first += before;
      if (c.second >= 0) c.second += before;
      p.contacts.push_back(c);
    }
  }
  const Options o;
  BodySolver one(o);
  const BodySolution expected = alone(one, p);
  Shared shared(o, anywhere(p.bodies.size(), 2));
  const BodySolution s = BodySolver(shared.options).solve(p.bodies, p.contacts);
  CHECK(same(expected, s));
  CHECK(expected.status == Status::solved);
  CHECK(s.islands == 40);
  CHECK(shared.messages.traffic.messages == 0 && shared.messages.traffic.bytes == 0);
}

// None at all; one that falls onto a floor, which is a body.
void few_bodies() {
  Shared shared(Options(), {});
  BodySolver solver(shared.options);
  CHECK(solver.solve({}, {}).status == Status::solved);
  Packing p;
  p.bodies.resize(2);
  p.bodies[1].inverse_mass = 1;
  p.bodies[1].inverse_inertia = 2.5 * Eigen::Matrix3d::Identity();
  p.bodies[1].velocity = {0, 0, -1};
  PointContact c;
  c.first = 0;  // the floor
  c.second = 1;
  c.normal = -Eigen::Vector3d::UnitZ();
  c.r2 = {0, 0, -1};
  c.mu = 0.5;
  p.contacts.push_back(c);
  const BodySolution s = solver.solve(p.bodies, p.contacts);
  CHECK(s.status == Status::solved && s.islands == 1);
  for (const auto& v : s.velocities) CHECK(v.norm() < 1e-15);
  for (const auto& x : s.impulses) CHECK((x - Eigen::Vector3d(0, 0, -1)).norm() < 1e-15);
  // Wrong input makes all throw, and the solver goes on to serve.
  p.contacts[0].mu = -1;
  CHECK(contains(thrown<std::invalid_argument>([&] { solver.solve(p.bodies, p.contacts); }),
                 "must be finite and >= 0"));
  p.contacts[0].mu = 0.5;
  CHECK(solver.solve(p.bodies, p.contacts).status == Status::solved);
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  const int side = argc > 1 ? std::atoi(argv[1]) : 10;
  try {
    same_bits_as_one_process(side);
    same_bits_with_threads(side);
    islands_of_several_ranks_are_assembled();
    islands_of_one_rank_need_no_sweep_messages();
    few_bodies();
  } catch (const std::exception& e) {
    check_failed(__FILE__, __LINE__, e.what());
  }
  if (rank == 0) std::printf("%d ranks: all passed\n", ranks);
  MPI_Finalize();
}
