// Tether: contact::BodySolver over MPI ranks. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "delivery.hpp"
#include "impulse_directory.hpp"

namespace tether::contact_mpi {

using contact::BodySolution;
using contact::PointContact;
using contact::RigidBody;
using detail::Delivery;
using detail::WholeProblem;
using Eigen::Vector3d;

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Vectors one after the other.
template <class... Part>
void put(double* out, const Part&... part) {
  ((Eigen::Map<Part>(out) = part, out += part.size()), ...);
}
template <class... Part>
void get(const double* in, Part&... part) {
  ((part = Eigen::Map<const Part>(in), in += part.size()), ...);
}

// Bodies and contacts of the sweeps of this rank, in its numbering.
struct Part {
  std::vector<RigidBody> bodies;
  std::vector<PointContact> contacts;
  std::vector<Vector3d> starts;
};

}  // namespace

struct Solver::Implementation {
  Implementation(MPI_Comm comm, const Options& options) : messages(comm), ranks(options) {}

  void solve(const Share& share, Solution& out);
  void bring_bodies(const Share& share);
  void bring_contacts(const Share& share, const std::vector<Vector3d>& starts);
  void return_velocities(const Share& share, Solution& out);
  void return_impulses(const Share& share, Solution& out);
  void merge(Solution& out);

  detail::Messages messages;
  contact::RankSolver ranks;
  detail::ImpulseDirectory memory;
  // Data of a solve:
  WholeProblem whole;
  std::vector<int> local_body, local_contact;  // number -> place in the part, -1
  std::vector<int> given_body, given_contact;  // number -> place in the share, -1
  Part part;
  BodySolution found;
};

namespace {

void invert(const std::vector<int>& numbers, std::size_t of, std::vector<int>& place) {
  place.assign(of, -1);
  for (std::size_t k = 0; k < numbers.size(); ++k) place[at(numbers[k])] = static_cast<int>(k);
}

}  // namespace

// A body goes from its owner to the ranks that sweep its contacts.
void Solver::Implementation::bring_bodies(const Share& share) {
  std::vector<std::pair<int, int>> wanted;  // body, rank
  const std::vector<int>& sweeper = ranks.contact_ranks();
  const int me = messages.rank();
  for (std::size_t c = 0; c < sweeper.size(); ++c) {
    const contact::RankContact& ends = whole.contacts[c];
    for (int b : {ends.first, ends.second, ends.fixed})
      if (b >= 0 && (whole.owner[at(b)] == me || sweeper[c] == me))
        wanted.emplace_back(b, sweeper[c]);
  }
  std::sort(wanted.begin(), wanted.end());
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  Delivery delivery(messages, 16);
  for (const auto& [b, to] : wanted) delivery.add(b, whole.owner[at(b)], to);
  part.bodies.resize(ranks.bodies().size());
  delivery.run(
      [&](int b, double* out) {
        const RigidBody& body = share.bodies[at(given_body[at(b)])];
        out[0] = body.inverse_mass;
        put(out + 1, body.inverse_inertia, body.velocity, body.angular_velocity);
      },
      [&](int b, const double* in) {
        RigidBody& body = part.bodies[at(local_body[at(b)])];
        body.inverse_mass = in[0];
        get(in + 1, body.inverse_inertia, body.velocity, body.angular_velocity);
      });
}

// A contact goes from who has given it to who sweeps it.
void Solver::Implementation::bring_contacts(const Share& share,
                                            const std::vector<Vector3d>& starts) {
  Delivery delivery(messages, 19);
  const std::vector<int>& sweeper = ranks.contact_ranks();
  for (std::size_t c = 0; c < sweeper.size(); ++c)
    delivery.add(static_cast<int>(c), whole.giver[c], sweeper[c]);
  part.contacts.resize(ranks.contacts().size());
  part.starts.resize(starts.empty() ? 0 : part.contacts.size());
  // The ranks of an empty share have no starts, while others have some.
  if (ranks.options().warm_start) part.starts.resize(part.contacts.size());
  delivery.run(
      [&](int c, double* out) {
        const int i = given_contact[at(c)];
        const PointContact& k = share.contacts[at(i)];
        out[0] = k.first;
        out[1] = k.second;
        out[2] = k.mu;
        out[3] = k.bias;
        put(out + 4, k.r1, k.r2, k.normal, k.slip,
            starts.empty() ? Vector3d(0, 0, 0) : starts[at(i)]);
      },
      [&](int c, const double* in) {
        const int i = local_contact[at(c)];
        PointContact& k = part.contacts[at(i)];
        k.first = local_body[at(static_cast<int>(in[0]))];
        k.second = in[1] < 0 ? -1 : local_body[at(static_cast<int>(in[1]))];
        k.mu = in[2];
        k.bias = in[3];
        Vector3d start;
        get(in + 4, k.r1, k.r2, k.normal, k.slip, start);
        if (!part.starts.empty()) part.starts[at(i)] = start;
      });
}

void Solver::Implementation::return_velocities(const Share& share, Solution& out) {
  const std::vector<int>& home = ranks.body_ranks();
  out.velocities.resize(share.bodies.size());
  out.angular_velocities.resize(share.bodies.size());
  for (std::size_t k = 0; k < share.bodies.size(); ++k) {
    out.velocities[k] = share.bodies[k].velocity;
    out.angular_velocities[k] = share.bodies[k].angular_velocity;
  }
  std::vector<char> moved(home.size(), 0);
  for (const contact::RankContact& c : whole.contacts)
    for (int b : {c.first, c.second})
      if (b >= 0) moved[at(b)] = 1;
  Delivery delivery(messages, 6);
  for (std::size_t b = 0; b < home.size(); ++b)
    if (moved[b]) delivery.add(static_cast<int>(b), home[b], whole.owner[b]);
  delivery.run(
      [&](int b, double* to) {
        const std::size_t k = at(local_body[at(b)]);
        put(to, found.velocities[k], found.angular_velocities[k]);
      },
      [&](int b, const double* from) {
        const std::size_t k = at(given_body[at(b)]);
        get(from, out.velocities[k], out.angular_velocities[k]);
      });
}

void Solver::Implementation::return_impulses(const Share& share, Solution& out) {
  out.impulses.resize(share.contacts.size());
  out.regimes.resize(share.contacts.size());
  out.replaced.clear();
  std::vector<char> replaced(found.impulses.size(), 0);
  for (int i : found.replaced) replaced[at(i)] = 1;
  Delivery delivery(messages, 5);
  const std::vector<int>& sweeper = ranks.contact_ranks();
  for (std::size_t c = 0; c < sweeper.size(); ++c)
    delivery.add(static_cast<int>(c), sweeper[c], whole.giver[c]);
  delivery.run(
      [&](int c, double* to) {
        const std::size_t i = at(local_contact[at(c)]);
        put(to, found.impulses[i]);
        to[3] = static_cast<double>(found.regimes[i]);
        to[4] = replaced[i];
      },
      [&](int c, const double* from) {
        const int i = given_contact[at(c)];
        get(from, out.impulses[at(i)]);
        out.regimes[at(i)] = static_cast<contact::Regime>(from[3]);
        if (from[4] != 0) out.replaced.push_back(i);
      });
  std::sort(out.replaced.begin(), out.replaced.end());
}

// Merges the numbers that are about all ranks.
void Solver::Implementation::merge(Solution& out) {
  struct Own {
    int status, assembled, failed, sweeps, colours, islands, shared;
    double error;
  };
  const contact::RankIslands islands = ranks.islands();
  const Own own{static_cast<int>(found.status),
                islands.assembled,
                islands.failed,
                found.sweeps,
                found.colours,
                islands.all,
                islands.shared,
                found.error};
  out.status = contact::Status::solved;
  out.error = 0;
  out.sweeps = out.colours = out.assembled_islands = out.failed_islands = 0;
  for (const Own& r : messages.gather_all(std::vector<Own>{own})) {
    out.status = contact::worse(out.status, static_cast<contact::Status>(r.status));
    out.error = r.error != r.error ? r.error : std::max(out.error, r.error);
    out.sweeps = std::max(out.sweeps, r.sweeps);
    out.colours = std::max(out.colours, r.colours);
    out.assembled_islands += r.assembled;
    out.failed_islands += r.failed;
  }
  out.islands = islands.all;
  out.shared_islands = islands.shared;
}

void Solver::Implementation::solve(const Share& share, Solution& out) {
  messages.traffic = {};
  whole = detail::whole_problem(messages, share, ranks.options().law);
  const std::size_t bodies = whole.owner.size(), contacts = whole.contacts.size();
  ranks.plan(whole.contacts, whole.owner, messages.size(), messages.rank());
  invert(ranks.bodies(), bodies, local_body);
  invert(ranks.contacts(), contacts, local_contact);
  invert(share.numbers, bodies, given_body);
  invert(whole.mine, contacts, given_contact);
  const bool warm = ranks.options().warm_start;
  std::vector<Vector3d> starts;
  out.warm_started = 0;
  if (warm) starts = memory.find(messages, share.contacts, out.warm_started);
  bring_bodies(share);
  bring_contacts(share, starts);
  std::exception_ptr failure;
  messages.sweeping = true;
  try {
    ranks.solve(part.bodies, part.contacts, part.starts, messages, found);
  } catch (...) {
    failure = std::current_exception();
  }
  messages.sweeping = false;
  agree(messages.comm(), failure);
  return_velocities(share, out);
  return_impulses(share, out);
  merge(out);
  if (warm) memory.keep(messages, share.contacts, out.impulses);
  out.plan = ranks.traffic();
  out.swept_contacts = static_cast<int>(part.contacts.size());
  out.traffic = messages.traffic;
}

Solver::Solver(MPI_Comm comm, const Options& options) {
  std::exception_ptr failure;
  try {
    implementation_ = std::make_unique<Implementation>(comm, options);
  } catch (...) {
    failure = std::current_exception();
  }
  agree(comm, failure);
  detail::require_same(implementation_->messages, options);
}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

Solution Solver::solve(const Share& share) {
  Solution out;
  solve(share, out);
  return out;
}
void Solver::solve(const Share& share, Solution& solution) {
  implementation_->solve(share, solution);
}
void Solver::scale_warm_start(double factor) {
  if (!(factor >= 0) || !std::isfinite(factor))
    throw std::invalid_argument("factor = " + std::to_string(factor) + ": must be finite and >= 0");
  implementation_->memory.scale(factor);
}
void Solver::forget() { implementation_->memory.forget(); }

}  // namespace tether::contact_mpi
