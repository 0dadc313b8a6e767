// Tether: contacts over MPI ranks against one process. SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n N ranks [side of the packings]
#include <array>
#include <cmath>
#include <limits>

#include "check.hpp"
#include "shares.hpp"

namespace {

using namespace tether::contact_mpi;
using tether::contact::BodySolution;
using tether::contact::BodySolver;
using tether::contact::Law;
using tether::contact::PointContact;
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
  sort_contacts(p);
  return p;
}

// Slabs, or anywhere, such that neighbours are mostly on other ranks.
std::vector<int> slabs(std::size_t bodies) {
  std::vector<int> owner(bodies);
  for (std::size_t b = 0; b < bodies; ++b)
    owner[b] = static_cast<int>(b * static_cast<std::size_t>(ranks) / bodies);
  return owner;
}
std::vector<int> anywhere(std::size_t bodies, std::uint64_t seed) {
  Generator g(seed);
  std::vector<int> owner(bodies);
  for (int& r : owner) r = std::min(ranks - 1, static_cast<int>(g.uniform(0, ranks)));
  return owner;
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

// A problem of one island: a rank sends velocities alone, one sum ends each pass, and all sweep
// alike many contacts.
void check_shares(const Solution& s, std::size_t contacts) {
  CHECK(s.shared_islands == (ranks > 1 ? 1 : 0));
  CHECK(s.swept_contacts * ranks <= 1.1 * static_cast<double>(contacts) + 400 * (ranks - 1));
  if (ranks == 1) return;
  CHECK(s.traffic.messages >= s.sweeps && s.traffic.bytes % 48 == 0);
  CHECK(s.traffic.reductions > s.sweeps && s.traffic.reductions < 2 * s.sweeps + 6);
}

void same_bits_as_one_process(int side) {
  for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
    Options o;
    o.law = law;
    o.max_sweeps = law == Law::coulomb ? 100 : 25;
    o.max_assembled = 0;
    Packing p = mixed(side, 7);
    BodySolver one(o);
    Solver solver(MPI_COMM_WORLD, o);
    // Bodies change their ranks between solves; impulses are found all the same.
    for (int solve = 0; solve < 2; ++solve) {
      const BodySolution expected = alone(one, p);
      const std::size_t n = p.bodies.size();
      const Shares shares = share_of(p, solve == 0 ? slabs(n) : anywhere(n, 3), rank);
      const Solution s = solver.solve(shares.share);
      CHECK(same(expected, s, shares));
      CHECK(s.warm_started == (solve == 0 ? 0 : static_cast<int>(p.contacts.size())));
      check_shares(s, p.contacts.size());
      for (std::size_t k = 0; k < p.contacts.size(); ++k) p.contacts[k].bias = 1e-3;
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
  const Shares shares = share_of(p, slabs(p.bodies.size()), rank);
  CHECK(same(expected, Solver(MPI_COMM_WORLD, o).solve(shares.share), shares));
}

// Sweeps end early, and one rank goes on with all of it.
void islands_of_several_ranks_are_assembled() {
  Packing p = tether::contact::random::packing(9, true, 5);
  for (PointContact& c : p.contacts) c.mu = 0.7;
  sort_contacts(p);
  Options o;
  o.tolerance = 1e-7;
  o.max_sweeps = 20;
  o.max_work = 1e8;
  BodySolver one(o);
  const BodySolution expected = alone(one, p);
  CHECK(expected.assembled_islands == 1);
  const Shares shares = share_of(p, anywhere(p.bodies.size(), 1), rank);
  const Solution s = Solver(MPI_COMM_WORLD, o).solve(shares.share);
  CHECK(same(expected, s, shares));
  CHECK(s.shared_islands == (ranks > 1 ? 1 : 0));
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
  sort_contacts(p);
  const Options o;
  BodySolver one(o);
  const BodySolution expected = alone(one, p);
  const Shares shares = share_of(p, anywhere(p.bodies.size(), 2), rank);
  const Solution s = Solver(MPI_COMM_WORLD, o).solve(shares.share);
  CHECK(same(expected, s, shares));
  CHECK(expected.status == Status::solved);
  CHECK(s.islands == 40 && s.shared_islands == 0);
  CHECK(s.traffic.messages == 0 && s.traffic.bytes == 0);
}

void few_bodies() {
  Solver solver(MPI_COMM_WORLD);
  // None at all; one that falls onto a floor, which another rank owns.
  CHECK(solver.solve(Share{}).status == Status::solved);
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
  for (int on : {0, ranks - 1}) {
    const Shares shares = share_of(p, {ranks - 1 - on, on}, rank);
    const Solution s = solver.solve(shares.share);
    CHECK(s.status == Status::solved && s.islands == 1);
    for (std::size_t k = 0; k < shares.share.numbers.size(); ++k)
      CHECK(s.velocities[k].norm() < 1e-15);
    for (const auto& x : s.impulses) CHECK((x - Eigen::Vector3d(0, 0, -1)).norm() < 1e-15);
  }
}

// Wrong input of the last rank makes all throw, and the solver goes on to serve.
void bad_input_is_refused_by_all() {
  const Packing good = mixed(3, 1);
  const std::vector<int> owner = slabs(good.bodies.size());
  const int last = ranks - 1;
  Solver solver(MPI_COMM_WORLD);
  const auto refused = [&](const std::string& text, auto&& spoil) {
    Shares s = share_of(good, owner, rank);
    if (rank == last) spoil(s.share);
    CHECK(contains(thrown<std::invalid_argument>([&] { solver.solve(s.share); }), text));
  };
  const std::string who = "rank " + std::to_string(last) + ": ";
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused(who + "body 26: velocity(0) = nan",
          [&](Share& s) { s.bodies[s.bodies.size() - 2].velocity[0] = nan; });
  refused("contact 0: bias = nan", [&](Share& s) {
    s.contacts.assign(1, PointContact{});
    s.contacts[0].first = s.numbers[0];
    s.contacts[0].bias = nan;
  });
  refused("must be finite and >= 0", [&](Share& s) {
    s.contacts.assign(1, PointContact{});
    s.contacts[0].first = s.numbers[0];
    s.contacts[0].mu = -1;
  });
  refused("number of a body = 1000: the 28 bodies of all ranks have the numbers 0 .. 27",
          [](Share& s) { s.numbers[0] = 1000; });
  refused("number of a body = -1", [](Share& s) { s.numbers[0] = -1; });
  refused("is on rank", [](Share& s) { s.numbers[0] = s.numbers[1]; });
  refused("numbers of bodies, but", [](Share& s) { s.numbers.pop_back(); });
  refused("joins fixed bodies", [](Share& s) {
    s.contacts.assign(1, PointContact{});
    s.contacts[0].first = 27;
  });
  if (ranks > 1) {
    refused("belongs to rank 0, which owns body 0", [](Share& s) {
      s.contacts.assign(1, PointContact{});
      s.contacts[0].first = 0;
    });
  }
  const Shares shares = share_of(good, owner, rank);
  BodySolver one;
  CHECK(same(alone(one, good), solver.solve(shares.share), shares));
  // Options, too.
  Options o;
  if (rank == last) o.tolerance = -1;
  CHECK(contains(thrown<std::invalid_argument>([&] { Solver(MPI_COMM_WORLD, o); }),
                 "rank " + std::to_string(last) + ": tolerance = -1"));
  o.tolerance = rank == last ? 1e-3 : 1e-4;
  if (ranks > 1) {
    CHECK(contains(thrown<std::invalid_argument>([&] { Solver(MPI_COMM_WORLD, o); }),
                   "tolerance is 0.000100 on one rank and 0.001000 on another"));
  }
  // Whatever one rank throws.
  const auto failure =
      rank == last ? std::make_exception_ptr(std::bad_alloc()) : std::exception_ptr();
  CHECK(contains(thrown<std::runtime_error>([&] { agree(MPI_COMM_WORLD, failure); }),
                 "rank " + std::to_string(last) + ": std::bad_alloc"));
}

void items_go_to_their_ranks() {
  // Each rank sends its number and the receiver's to all, the highest rank first.
  std::vector<double> items;
  std::vector<int> to;
  for (int r = ranks; r-- > 0;) {
    items.insert(items.end(), {static_cast<double>(rank), static_cast<double>(r)});
    to.push_back(r);
  }
  const std::vector<double> come = send(MPI_COMM_WORLD, 2, items, to);
  CHECK(come.size() == 2 * at(ranks));
  for (int r = 0; r < ranks; ++r) CHECK(come[2 * at(r)] == r && come[2 * at(r) + 1] == rank);
  CHECK(send(MPI_COMM_WORLD, 3, {}, {}).empty());
  if (rank == ranks - 1) to[0] = ranks;
  CHECK(contains(
      thrown<std::invalid_argument>([&] { send(MPI_COMM_WORLD, 2, items, to); }),
      "to[0] = " + std::to_string(ranks) + ": must lie in 0 .. " + std::to_string(ranks - 1)));
}

// Half of the weight in a corner: each rank has its part of it.
void bodies_are_spread_by_weight() {
  std::vector<int> numbers;
  std::vector<Eigen::Vector3d> centres;
  std::vector<double> weights;
  constexpr int kSide = 24;
  double sum = 0, own = 0;
  for (int k = 0; k < kSide * kSide * kSide; ++k) {
    const Eigen::Vector3d centre(k % kSide, k / kSide % kSide, k / kSide / kSide);
    const double weight = centre.maxCoeff() < 12 ? 7 : 1;
    sum += weight;
    if (k % ranks != rank) continue;
    numbers.push_back(k);
    centres.push_back(centre);
    weights.push_back(weight);
  }
  const std::vector<int> to = partition(MPI_COMM_WORLD, numbers, centres, weights);
  std::vector<double> loads(at(ranks), 0);
  for (std::size_t k = 0; k < to.size(); ++k) loads[at(to[k])] += weights[k];
  MPI_Allreduce(MPI_IN_PLACE, loads.data(), ranks, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  own = loads[at(rank)];
  CHECK(own <= 1.12 * sum / ranks && own >= 0.88 * sum / ranks);
  if (rank == ranks - 1) weights[0] = -1;
  CHECK(contains(
      thrown<std::invalid_argument>([&] { partition(MPI_COMM_WORLD, numbers, centres, weights); }),
      "weight must lie in 0 .. 1e30"));
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
    bad_input_is_refused_by_all();
    bodies_are_spread_by_weight();
    items_go_to_their_ranks();
  } catch (const std::exception& e) {
    check_failed(__FILE__, __LINE__, e.what());
  }
  if (rank == 0) std::printf("%d ranks: all passed\n", ranks);
  MPI_Finalize();
}
