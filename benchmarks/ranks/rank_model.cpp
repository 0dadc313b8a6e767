// Tether: sweeps over ranks on a simulated cluster: a model, no measurement.
// SPDX-License-Identifier: BSD-3-Clause
//
//   smpirun -np RANKS -platform FILE rank_model CONTACTS_A_RANK NS_A_CONTACT [SWEEPS]
//
// Compiled by SimGrid's smpicxx (rank_model.sh). A cube of spheres, owned in blocks. The plan (who
// sweeps which chunks, who tells whom after which colour) is contact::detail::RankPlan's,
// and so are the messages and the sum after a sweep: contact_mpi::Messages.
// Only the sweeping itself is time that passes: NS_A_CONTACT for each contact of a colour. All
// ranks are threads of one process, which share the graph of all contacts.
#include <mpi.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <tether/contact_mpi.hpp>
#include <vector>

#include "ranks/rank_plan.hpp"

namespace {

using namespace tether::contact;
using detail::Chunk;
using detail::RankPlan;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Ranks in three directions, as equal as they can be.
std::array<int, 3> blocks(int ranks) {
  std::array<int, 3> out = {1, 1, 1};
  for (int factor = 2; ranks > 1;) {
    if (ranks % factor != 0) {
      ++factor;
      continue;
    }
    *std::min_element(out.begin(), out.end()) *= factor;
    ranks /= factor;
  }
  return out;
}

// Work of a rank in a sweep, colour by colour: contacts, and bodies to and from others.
struct Colour {
  int contacts = 0;
  std::map<int, int> to, from;
};

struct Model {
  int contacts = 0, chunks = 0, shared = 0;
  std::vector<std::vector<Colour>> of;  // rank, colour
  std::vector<int> swept;               // contacts of each rank
};

struct Lattice {
  std::vector<int> first, second, owner;
  std::vector<detail::Kind> kinds;
  void add(int one, int other) {
    first.push_back(one);
    second.push_back(other);
    kinds.push_back(detail::Kind::sphere);
  }
};

Lattice lattice(const std::array<int, 3>& ranks, int side) {
  Lattice out;
  const int nx = ranks[0] * side, ny = ranks[1] * side, nz = ranks[2] * side;
  const auto body = [&](int x, int y, int z) { return (z * ny + y) * nx + x; };
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        out.owner.push_back((z / side * ranks[1] + y / side) * ranks[0] + x / side);
        const int i = body(x, y, z);
        if (z == 0) out.add(i, -1);
        if (z > 0) out.add(i, body(x, y, z - 1));
        if (y > 0) out.add(i, body(x, y - 1, z));
        if (x > 0) out.add(i, body(x - 1, y, z));
      }
  return out;
}

// As RankPlan::exchanges finds them for one rank, for all at once.
Model model(int ranks, int side) {
  const Lattice contacts = lattice(blocks(ranks), side);
  const std::vector<int>& owner = contacts.owner;
  RankPlan plan;
  plan.build(contacts.first, contacts.second, contacts.kinds, owner, ranks, 0);
  Model out;
  out.contacts = static_cast<int>(contacts.first.size());
  out.chunks = static_cast<int>(plan.whole.chunks.size()) - 1;
  out.swept.assign(at(ranks), 0);
  const detail::Island& island = plan.whole.islands[0];
  out.of.assign(at(ranks), std::vector<Colour>(at(island.colour_end - island.colour_begin)));
  std::vector<int> last_rank(owner.size(), -1), last_colour(owner.size()), home(owner.size(), -1);
  const auto pass_on = [&](int b, int to) {
    const int from = last_rank[at(b)];
    if (from == to) return;
    ++out.of[at(from)][at(last_colour[at(b)])].to[to];
    ++out.of[at(to)][at(last_colour[at(b)])].from[from];
  };
  for (int k = island.colour_begin; k < island.colour_end; ++k)
    for (int c = plan.whole.colours[at(k)]; c < plan.whole.colours[at(k + 1)]; ++c) {
      const int by = plan.chunk_rank[at(c)];
      const Chunk &one = plan.whole.chunks[at(c)], &behind = plan.whole.chunks[at(c + 1)];
      out.of[at(by)][at(k - island.colour_begin)].contacts += behind.place - one.place;
      out.swept[at(by)] += behind.place - one.place;
      for (int p = one.place; p < behind.place; ++p)
        for (int b : {contacts.first[at(plan.whole.order[at(p)])],
                      contacts.second[at(plan.whole.order[at(p)])]}) {
          if (b < 0) continue;
          if (last_rank[at(b)] < 0)
            home[at(b)] = by;
          else
            pass_on(b, by);
          last_rank[at(b)] = by;
          last_colour[at(b)] = k - island.colour_begin;
        }
    }
  for (std::size_t b = 0; b < owner.size(); ++b)
    if (last_rank[b] >= 0) pass_on(static_cast<int>(b), home[b]);
  // Rank 0 by its own plan: the same messages and velocities.
  long long messages = 0, velocities = 0, planned_messages = 0, planned_velocities = 0;
  for (const Colour& colour : out.of[0])
    for (const auto& [rank, bodies] : colour.to) ++messages, velocities += bodies;
  for (const detail::RankExchanges& colour : plan.after)
    for (const detail::RankExchange& e : colour) {
      planned_messages += !e.send.empty();
      planned_velocities += static_cast<long long>(e.send.size());
    }
  if (messages != planned_messages || velocities != planned_velocities) {
    std::fprintf(stderr, "rank_model: not what RankPlan says\n");
    std::exit(1);
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int ranks = 1, rank = 0;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (argc < 3) {
    if (rank == 0) std::fprintf(stderr, "rank_model CONTACTS_A_RANK NS_A_CONTACT [SWEEPS]\n");
    MPI_Finalize();
    return 2;
  }
  const int side = static_cast<int>(std::lround(std::cbrt(std::atof(argv[1]) / 3)));
  const double ns = std::atof(argv[2]);
  const int sweeps = argc > 3 ? std::atoi(argv[3]) : 20;
  // All ranks of the one process share the model: whoever comes first makes it, without simulated
  // time.
  static const Model shared = model(ranks, side);
  const std::vector<Colour>& mine = shared.of[at(rank)];
  tether::contact_mpi::Messages messages(MPI_COMM_WORLD);
  std::vector<std::vector<RankMessages::With>> with;
  for (const Colour& colour : mine) {
    std::map<int, RankMessages::With> of;
    for (const auto& [other, bodies] : colour.to) of[other].out.resize(6 * at(bodies));
    for (const auto& [other, bodies] : colour.from) of[other].in.resize(6 * at(bodies));
    with.emplace_back();
    for (auto& [other, w] : of) {
      w.rank = other;
      with.back().push_back(std::move(w));
    }
  }
  std::vector<double> sums(3 * at(shared.chunks), 0);
  double wait[3] = {0, 0, 0};  // sweeping, telling, summing
  MPI_Barrier(MPI_COMM_WORLD);
  const double begin = MPI_Wtime();
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t k = 0; k < mine.size(); ++k) {
      double t = MPI_Wtime();
      smpi_execute(1e-9 * ns * mine[k].contacts);
      wait[0] += MPI_Wtime() - t;
      t = MPI_Wtime();
      if (!with[k].empty()) messages.exchange(with[k]);
      wait[1] += MPI_Wtime() - t;
    }
    const double t = MPI_Wtime();
    if (ranks > 1) messages.sum(sums);
    wait[2] += MPI_Wtime() - t;
  }
  const double time = (MPI_Wtime() - begin) / sweeps;
  if (rank == 0) {
    int most = 0;
    for (int n : shared.swept) most = std::max(most, n);
    std::printf("%5d %9d %8d %8.1f %8.1f %8.1f %8.1f %8.2f %8.1f %8.1f\n", ranks, shared.contacts,
                most, 1e6 * time, 1e6 * wait[0] / sweeps, 1e6 * wait[1] / sweeps,
                1e6 * wait[2] / sweeps, 1e-3 * ns * shared.contacts / ranks / (1e6 * time),
                static_cast<double>(messages.traffic.messages) / sweeps,
                static_cast<double>(messages.traffic.bytes) / sweeps / 1000);
  }
  MPI_Finalize();
  return 0;
}
