// Tether: data shared by the parts of BodySolver. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <limits>
#include <memory>
#include <string>
#include <tether/contact/body_solver.hpp>
#include <vector>

#include "body_sweeps/body_kernels.hpp"
#include "body_sweeps/contact_graph.hpp"
#include "body_sweeps/impulse_memory.hpp"
#include "body_sweeps/worker_team.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {

struct IslandResult {
  Status status = Status::unsolved;
  int sweeps = 0;
  double error = 0;
  double inverse_scale = 0;  // 1 / velocity scale
  double floor = 0;          // squares of errors up to here are round-off of the bodies' velocities
  double relative(double square) const {
    return square <= floor ? 0 : std::sqrt(square) * inverse_scale;
  }
  bool assemblable = false;  // unsolved, and a Problem of it is allowed and affordable
  bool assembled = false;
  bool saved = false;  // an earlier point was the best and is unpacked already
};

// What a pass over contacts adds up, in squares of velocities: before the first sweep |b|^2 and the
// largest speed, and the largest needed change itself; later errors.
struct PassResult : Squares {
  double speed = 0;
  PassResult() = default;
  PassResult(const Squares& s) : Squares(s) {}
  void add(const PassResult& r) {
    sum += r.sum;
    most = most > r.most ? most : r.most;
    speed = speed > r.speed ? speed : r.speed;
  }
};

// Data of one thread.
struct Worker {
  alignas(64) BodyState nowhere = {};
  std::unique_ptr<Solver> solver;
  Solution solution;
  std::vector<Body> bodies;
  std::vector<BodyContact> contacts;
  std::vector<int> replaced;
  std::exception_ptr failure;
  int bad_contact = std::numeric_limits<int>::max();
  std::string bad_reason;
};

// The threads that work on an island: all, or one.
struct Team {
  int thread, threads;
  Barrier* barrier;
  Worker* worker;
  void meet() const {
    if (threads > 1) barrier->wait();
  }
  int from(int begin, int end) const { return part(begin, end, thread); }
  int to(int begin, int end) const { return part(begin, end, thread + 1); }
  int part(int begin, int end, int k) const {
    return begin + static_cast<int>(static_cast<long long>(end - begin) * k / threads);
  }
};

}  // namespace tether::contact::detail

namespace tether::contact {

struct BodySolver::Implementation {
  using BodyArrays = detail::BodyArrays;
  using BodyInertia = detail::BodyInertia;
  using BodyState = detail::BodyState;
  using Chunk = detail::Chunk;
  using GeneralContact = detail::GeneralContact;
  using GeneralGroup = detail::GeneralGroup;
  using Coupled = detail::Coupled;
  using Island = detail::Island;
  using IslandResult = detail::IslandResult;
  using Kind = detail::Kind;
  using PassResult = detail::PassResult;
  using SmoothContact = detail::SmoothContact;
  using SphereContact = detail::SphereContact;
  using SphereGroup = detail::SphereGroup;
  using Team = detail::Team;
  using Vector3d = Eigen::Vector3d;
  using Worker = detail::Worker;
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  BodyOptions options;
  detail::WorkerTeam threads_;
  detail::ContactGraph graph;
  detail::ImpulseMemory memory, memory_before;  // of the last solve, and of the one before it
  std::vector<std::unique_ptr<Worker>> workers;

  // The present problem; the caller's.
  const std::vector<RigidBody>* bodies = nullptr;
  const std::vector<PointContact>* contacts = nullptr;
  BodySolution* out = nullptr;

  // For each contact.
  std::vector<int> first, second;  // moving bodies; second -1: fixed
  std::vector<Kind> kind;
  std::vector<char> turned;            // first and second of the caller exchanged
  std::vector<const Vector3d*> start;  // impulse of the previous solve
  std::vector<GeneralGroup> general4;
  std::vector<SphereGroup> spheres4;
  std::vector<GeneralContact> general;
  std::vector<SphereContact> spheres;
  std::vector<SmoothContact> smooth;
  // For each body, slot, chunk, island.
  std::vector<char> body_kind;
  std::vector<int> fixed_slot;  // 0: at rest, as the world
  std::vector<BodyState> fixed;
  std::vector<BodyState> state;
  std::vector<BodyInertia> inertia;
  std::vector<PassResult> chunk_sum[2];  // in turns: a thread may still read those of the last pass
  std::vector<IslandResult> results;
  std::vector<double> previous_impulse, previous_velocity;  // for the momentum

  enum class Pass { pack, sweep, test, unpack };

  void solve(const std::vector<RigidBody>& b, const std::vector<PointContact>& c, BodySolution& o);
  void read_bodies();
  void read_contacts();
  void find_starts();
  void finish();

  void together(int k, const Team& team);
  void alone(int k, Worker& worker);
  void unpack(const Island& island, const Team& team);
  bool assemblable(int k) const { return results[at(k)].assemblable; }
  void iterate(int k, const Team& team);
  void save(const Island& island, const Team& team);
  void extrapolate(const Island& island, const Team& team, double beta);
  void assemble(int k, Worker& worker);
  void judge_with_long_sums(int k);

  int cut(int begin, int end, int k, int parts) const;
  template <class Operation>
  PassResult pass(const Island& island, const Team& team, int& turn, const Operation& operation);
  template <class Operation>
  PassResult over_kinds(int chunk, const Team& team, const Operation& operation);
  PassResult sweep(int chunk, const Team& team);
  PassResult test(int chunk, const Team& team);
  PassResult pack(int chunk, Worker& worker);
  void unpack(int chunk);
  template <class Visit>
  void visit(int chunk, const Visit& visit);
  PassResult pack_contact(int contact, Kind k, int place);
  void rest(const Island& island, const Team& team, int& turn);
  GeneralContact general_contact(Kind k, int place) const;
  SphereContact sphere_contact(Kind k, int place) const;
  void put(const GeneralContact& c, Kind k, int place);
  void put(const SphereContact& c, Kind k, int place);
  Vector3d impulse(Kind k, int place) const;
  void set_impulse(Kind k, int place, const Vector3d& p);
  void apply(int contact, const Vector3d& p);
  void load_body(int slot);
};

// visit(contact, kind, place among the contacts of this kind)
template <class Visit>
void BodySolver::Implementation::visit(int chunk, const Visit& visit) {
  const Chunk &c = graph.chunks[at(chunk)], &next = graph.chunks[at(chunk + 1)];
  int place = c.place;
  for (int k = 0; k < detail::kKinds; ++k) {
    for (int i = c.begin[k]; i < next.begin[k]; ++i) {
      visit(graph.order[at(place++)], static_cast<Kind>(k), i);
    }
  }
}

// operation(chunk) for all chunks of the island, colour by colour; what it returns together, in
// an order that no thread count changes.
template <class Operation>
detail::PassResult BodySolver::Implementation::pass(const Island& island, const Team& team,
                                                    int& turn, const Operation& operation) {
  turn = 1 - turn;
  std::vector<PassResult>& sums = chunk_sum[turn];
  for (int k = island.colour_begin; k < island.colour_end; ++k) {
    const int begin =
        cut(graph.colours[at(k)], graph.colours[at(k + 1)], team.thread, team.threads);
    const int end =
        cut(graph.colours[at(k)], graph.colours[at(k + 1)], team.thread + 1, team.threads);
    for (int c = begin; c < end; ++c) sums[at(c)] = operation(c);
    team.meet();
  }
  PassResult sum;
  for (int c = island.chunk_begin; c < island.chunk_end; ++c) sum.add(sums[at(c)]);
  return sum;
}

}  // namespace tether::contact
