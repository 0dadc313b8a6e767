// Tether: contacts over ranks, with the bits of one process. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <string>
#include <tether/contact_mpi.hpp>
#include <utility>

#include "messages.hpp"

namespace tether::contact_mpi {

using contact::PointContact;
using contact::RigidBody;
using Eigen::Vector3d;

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Numbers of a body and its own; of a contact, with the bits of its identity.
constexpr std::size_t kBody = 17, kContact = 17;

// Vectors one after the other.
template <class... Part>
void put(std::vector<double>& out, const Part&... part) {
  (out.insert(out.end(), part.data(), part.data() + part.size()), ...);
}
template <class... Part>
void get(const double* in, Part&... part) {
  ((part = Eigen::Map<const Part>(in), in += part.size()), ...);
}

template <class Work>
void by_all(MPI_Comm comm, const Work& work) {
  std::exception_ptr failure;
  try {
    work();
  } catch (...) {
    failure = std::current_exception();
  }
  agree(comm, failure);
}

void require_same(MPI_Comm comm, const Options& b) {
  const std::vector<std::pair<const char*, double>> options = {{"law", static_cast<double>(b.law)},
                                                               {"tolerance", b.tolerance},
                                                               {"max_sweeps", b.max_sweeps},
                                                               {"min_sweeps", b.min_sweeps},
                                                               {"warm_start", b.warm_start},
                                                               {"max_assembled", b.max_assembled},
                                                               {"strict", b.strict},
                                                               {"max_work", b.max_work},
                                                               {"enough", b.enough}};
  std::vector<double> least, most;
  for (const auto& [name, value] : options) least.push_back(value);
  most = least;
  const int n = static_cast<int>(options.size());
  MPI_Allreduce(MPI_IN_PLACE, least.data(), n, MPI_DOUBLE, MPI_MIN, comm);
  MPI_Allreduce(MPI_IN_PLACE, most.data(), n, MPI_DOUBLE, MPI_MAX, comm);
  for (std::size_t k = 0; k < options.size(); ++k) {
    if (least[k] == most[k]) continue;
    throw std::invalid_argument(std::string(options[k].first) + " is " + std::to_string(least[k]) +
                                " on one rank and " + std::to_string(most[k]) +
                                " on another: all ranks need the same");
  }
}

}  // namespace

struct Solver::Implementation {
  Implementation(MPI_Comm comm, Options options)
      : messages(comm), team(messages, 0), solver([&] {
          options.team = &team;
          return options;
        }()) {}

  void solve(const Share& share, Solution& out);
  void gather_bodies(const Share& share);
  void place_body(int rank, int number, const double* numbers);
  void gather_contacts(const Share& share);
  void check_contacts(const Share& share) const;
  std::pair<int, int> moving_first(const PointContact& c) const;
  bool moves(int body) const { return body >= 0 && bodies[at(body)].moves(); }
  void refuse_by_name(const Share& share) const;
  void take_results(const Share& share, Solution& out) const;

  detail::Messages messages;
  contact::RankTeam team;
  contact::BodySolver solver;
  // The whole problem, alike on all ranks:
  std::vector<RigidBody> bodies;
  std::vector<int> owner;  // of bodies; -1: not yet known
  std::vector<PointContact> contacts;
  std::vector<int> own_contacts;  // contact of the share -> number
  contact::BodySolution found;
};

// The same on all ranks, and so is what it throws.
void Solver::Implementation::place_body(int rank, int number, const double* numbers) {
  const int n = static_cast<int>(bodies.size());
  if (number < 0 || number >= n)
    throw std::invalid_argument("rank " + std::to_string(rank) +
                                ": number of a body = " + std::to_string(number) + ": the " +
                                std::to_string(n) + " bodies of all ranks have the numbers 0 .. " +
                                std::to_string(n - 1));
  if (owner[at(number)] >= 0)
    throw std::invalid_argument("rank " + std::to_string(rank) + ": body " +
                                std::to_string(number) + " is on rank " +
                                std::to_string(owner[at(number)]) + ", too: each is on one rank");
  owner[at(number)] = rank;
  RigidBody& body = bodies[at(number)];
  body.inverse_mass = numbers[0];
  get(numbers + 1, body.inverse_inertia, body.velocity, body.angular_velocity);
}

void Solver::Implementation::gather_bodies(const Share& share) {
  std::vector<double> mine;
  mine.reserve(kBody * share.bodies.size());
  by_all(messages.comm(), [&] {
    if (share.numbers.size() != share.bodies.size())
      throw std::invalid_argument(std::to_string(share.numbers.size()) +
                                  " numbers of bodies, but " + std::to_string(share.bodies.size()) +
                                  " bodies");
  });
  for (std::size_t k = 0; k < share.bodies.size(); ++k) {
    const RigidBody& b = share.bodies[k];
    mine.insert(mine.end(), {static_cast<double>(share.numbers[k]), b.inverse_mass});
    put(mine, b.inverse_inertia, b.velocity, b.angular_velocity);
  }
  std::vector<int> ends;
  const std::vector<double> all = messages.gather_all(mine, &ends);
  bodies.assign(all.size() / kBody, {});
  owner.assign(bodies.size(), -1);
  int rank = 0;
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    while (k * kBody >= at(ends[at(rank)])) ++rank;
    place_body(rank, static_cast<int>(all[k * kBody]), all.data() + k * kBody + 1);
  }
  // evaluate() refuses bodies by their number.
  by_all(messages.comm(), [&] {
    std::vector<RigidBody> own(bodies.size());
    for (std::size_t k = 0; k < share.bodies.size(); ++k)
      own[at(share.numbers[k])] = share.bodies[k];
    contact::evaluate(own, {}, solver.options().law, {});
  });
}

// The moving body with the smaller number, and the other one.
std::pair<int, int> Solver::Implementation::moving_first(const PointContact& c) const {
  if (moves(c.first) && moves(c.second))
    return {std::min(c.first, c.second), std::max(c.first, c.second)};
  return moves(c.first) ? std::pair{c.first, c.second} : std::pair{c.second, c.first};
}

void Solver::Implementation::refuse_by_name(const Share& share) const {
  contact::evaluate(bodies, share.contacts, solver.options().law,
                    std::vector<Vector3d>(share.contacts.size(), Vector3d::Zero()));
}

void Solver::Implementation::check_contacts(const Share& share) const {
  const int n = static_cast<int>(bodies.size());
  for (std::size_t i = 0; i < share.contacts.size(); ++i) {
    const PointContact& c = share.contacts[i];
    if (c.first < 0 || c.first >= n || c.second >= n || !(moves(c.first) || moves(c.second)))
      refuse_by_name(share);
    const int body = moving_first(c).first;
    if (owner[at(body)] != messages.rank())
      throw std::invalid_argument("contact " + std::to_string(i) + " belongs to rank " +
                                  std::to_string(owner[at(body)]) + ", which owns body " +
                                  std::to_string(body) + ", the first of its bodies that can move");
  }
}

// In the order of (smaller number of a moving body, other number); contacts of two bodies are from
// one rank, in its order.
void Solver::Implementation::gather_contacts(const Share& share) {
  by_all(messages.comm(), [&] { check_contacts(share); });
  std::vector<double> mine;
  mine.reserve(kContact * share.contacts.size());
  for (const PointContact& c : share.contacts) {
    double id = 0;
    std::memcpy(&id, &c.id, sizeof(id));
    mine.insert(mine.end(),
                {id, static_cast<double>(c.first), static_cast<double>(c.second), c.mu, c.bias});
    put(mine, c.r1, c.r2, c.normal, c.slip);
  }
  std::vector<int> ends;
  const std::vector<double> all = messages.gather_all(mine, &ends);
  std::vector<PointContact> given(all.size() / kContact);
  for (std::size_t i = 0; i < given.size(); ++i) {
    const double* in = all.data() + i * kContact;
    PointContact& c = given[i];
    std::memcpy(&c.id, in, sizeof(c.id));
    c.first = static_cast<int>(in[1]);
    c.second = static_cast<int>(in[2]);
    c.mu = in[3];
    c.bias = in[4];
    get(in + 5, c.r1, c.r2, c.normal, c.slip);
  }
  std::vector<std::pair<std::pair<int, int>, int>> order;
  order.reserve(given.size());
  for (std::size_t i = 0; i < given.size(); ++i)
    order.emplace_back(moving_first(given[i]), static_cast<int>(i));
  if (!std::is_sorted(order.begin(), order.end())) std::sort(order.begin(), order.end());
  const int rank = messages.rank();
  const int first = (rank > 0 ? ends[at(rank - 1)] : 0) / static_cast<int>(kContact);
  const int count = static_cast<int>(share.contacts.size());
  own_contacts.resize(share.contacts.size());
  contacts.clear();
  contacts.reserve(given.size());
  for (const auto& each : order) {
    const int i = each.second;
    if (i >= first && i < first + count)
      own_contacts[at(i - first)] = static_cast<int>(contacts.size());
    contacts.push_back(given[at(i)]);
  }
}

void Solver::Implementation::take_results(const Share& share, Solution& out) const {
  out.status = found.status;
  out.error = found.error;
  out.islands = found.islands;
  out.assembled_islands = found.assembled_islands;
  out.failed_islands = found.failed_islands;
  out.sweeps = found.sweeps;
  out.colours = found.colours;
  out.warm_started = found.warm_started;
  out.impulses.clear();
  out.regimes.clear();
  out.replaced.clear();
  out.velocities.clear();
  out.angular_velocities.clear();
  for (std::size_t i = 0; i < own_contacts.size(); ++i) {
    out.impulses.push_back(found.impulses[at(own_contacts[i])]);
    out.regimes.push_back(found.regimes[at(own_contacts[i])]);
    if (std::binary_search(found.replaced.begin(), found.replaced.end(), own_contacts[i]))
      out.replaced.push_back(static_cast<int>(i));
  }
  for (const int body : share.numbers) {
    out.velocities.push_back(found.velocities[at(body)]);
    out.angular_velocities.push_back(found.angular_velocities[at(body)]);
  }
}

void Solver::Implementation::solve(const Share& share, Solution& out) {
  messages.traffic = {};
  gather_bodies(share);
  gather_contacts(share);
  team.set_owners(owner);
  const long swept = team.swept_contacts();
  std::exception_ptr failure;
  try {
    solver.solve(bodies, contacts, found);
  } catch (...) {
    failure = std::current_exception();
  }
  int failed = failure != nullptr;
  MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, messages.comm());
  if (failed != 0) {
    by_all(messages.comm(), [&] { refuse_by_name(share); });
    agree(messages.comm(), failure);
  }
  take_results(share, out);
  const bool alone = messages.size() == 1;
  out.shared_islands = alone ? 0 : team.shared_islands();
  out.swept_contacts =
      static_cast<int>(alone ? static_cast<long>(contacts.size()) : team.swept_contacts() - swept);
  out.traffic = messages.traffic;
}

Solver::Solver(MPI_Comm comm, const Options& options) {
  by_all(comm, [&] { implementation_ = std::make_unique<Implementation>(comm, options); });
  require_same(implementation_->messages.comm(), options);
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

void Solver::scale_warm_start(double factor) { implementation_->solver.scale_warm_start(factor); }
void Solver::forget() { implementation_->solver.forget(); }

}  // namespace tether::contact_mpi
