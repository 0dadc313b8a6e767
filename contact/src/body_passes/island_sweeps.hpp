// Tether: passes over the contacts of an island. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/body_solver.hpp>
#include <vector>

#include "body_passes/given_problem.hpp"
#include "body_passes/packed_contacts.hpp"
#include "body_passes/worker_team.hpp"
#include "graph/contact_graph.hpp"

namespace tether::contact::detail {

struct PassResult;

// Exchange between processes that share islands. Called by the first thread of each, in the same
// order.
class SweepPartners {
 public:
  virtual ~SweepPartners() = default;

  // Islands have the same numbers here and in the whole graph.
  virtual bool here(int island) const = 0;    // some contact of it
  virtual bool shared(int island) const = 0;  // several processes sweep it
  virtual const ContactGraph& whole() const = 0;
  virtual bool reports(int island) const = 0;  // this process, and no other
  // The calls below are about this island.
  virtual void begin(int island) = 0;

  // Velocities that the chunks of a colour have changed, to who sweeps these bodies next.
  virtual void after_colour(int colour, MovingBodies& bodies) = 0;
  // Velocities as they are after a sweep, to all that have the body.
  virtual void share(MovingBodies& bodies) = 0;
  // The sums of all processes; sums: of each chunk of this process.
  virtual PassResult total(const std::vector<PassResult>& sums) = 0;

  // After all islands: those to be assembled are brought together and solved. failed: this process
  // is about to throw.
  virtual void finish(bool failed) = 0;
  // The others wait for this process, which cannot go on: ends all of them.
  virtual void give_up(const char* why) = 0;
};

// Sums of a pass over contacts, in squares of velocities: before the first sweep |b|^2, the largest
// speed, the largest one that an impulse to start from has made, and the largest needed change
// itself; later errors.
struct PassResult : Squares {
  double speed = 0, started = 0;
  PassResult() = default;
  PassResult(const Squares& s) : Squares(s) {}
  void add(const PassResult& r) {
    sum += r.sum;
    most = most > r.most ? most : r.most;
    speed = speed > r.speed ? speed : r.speed;
    started = started > r.started ? started : r.started;
  }
};

// The impulses of all contacts and the velocities of all bodies during a solve, and what is done to
// those of one island by the threads of a team: each calls the same functions in the same order.
// The bits do not depend on the number of threads.
class IslandSweeps {
 public:
  // Called once before the islands; what it is given has to outlive the solve.
  void start(const GivenProblem& given, const ContactGraph& graph, Law law);

  // Bodies as before the impulses.
  void load(const Island& island, const Team& team);
  // Contacts with the impulses to start from, cut off at their friction cones; null or empty: zero.
  // Returns |b|^2, the largest needed change and speed.
  PassResult pack(const Island& island, Team& team, const std::vector<const Vector3d*>& start);
  // Velocities anew from the present impulses, without the round-off of larger ones before.
  void refresh(const Island& island, Team& team);
  // One sweep of block Gauss-Seidel; what it changed.
  PassResult sweep(const Island& island, Team& team);
  // Errors of the present impulses; changes nothing.
  PassResult test(const Island& island, Team& team);
  // x <- x + beta (x - previous x), and the same for the velocities, which follow x linearly.
  // Previous: at the last call.
  void extrapolate(const Island& island, const Team& team, double beta);
  // No impulses.
  void rest(const Island& island, Team& team);
  // Impulses, regimes and velocities to the caller.
  void unpack(const Island& island, Team& team, BodySolution& out);

  // visit(contact, kind, place) for the contacts of an island, in the order of sweeping.
  template <class Visit>
  void for_contacts(const Island& island, const Visit& visit) const {
    for (int c = island.chunk_begin; c < island.chunk_end; ++c) in_chunk(c, visit);
  }
  // World axes, on the first moving body.
  Vector3d impulse(Kind k, int place) const { return contacts_.impulse(k, place); }
  // As PackedContacts has it, without moving the bodies.
  Eigen::Vector4d state(Kind k, int place) const { return contacts_.state(k, place); }
  void set_state(Kind k, int place, const Eigen::Vector4d& s) { contacts_.set_state(k, place, s); }
  // In place of a zero impulse: moves the bodies.
  void add_impulse(int contact, Kind k, int place, const Vector3d& p);
  void set_velocity(int slot, const Vector3d& v, const Vector3d& w) {
    bodies_.set_velocity(slot, v, w);
  }

  bool has_general() const { return contacts_.has_general(); }

 private:
  template <class Visit>
  void in_chunk(int chunk, const Visit& visit) const;
  // Effect of a pass, beside its sums.
  enum class Pass { moves_bodies, reads_bodies, local };
  template <class Operation>
  PassResult pass(const Island& island, Team& team, Pass kind, const Operation& operation);
  template <class Operation>
  PassResult over_kinds(int chunk, const Team& team, const Operation& operation);
  int cut(int begin, int end, int k, int parts) const;
  PassResult pack_contact(int contact, Kind k, int place, const Vector3d* start);
  void unpack_contact(int contact, Kind k, int place, BodySolution& out) const;

  const GivenProblem* given_ = nullptr;
  const ContactGraph* graph_ = nullptr;
  Law law_ = Law::maximum_dissipation;
  PackedContacts contacts_;
  MovingBodies bodies_;
  std::vector<PassResult> sums_[2];  // of chunks, in turns: a thread may still read the last ones
  PassResult total_;                 // of all processes
};

template <class Visit>
void IslandSweeps::in_chunk(int chunk, const Visit& visit) const {
  const Chunk &c = graph_->chunks[linalg::at(chunk)], &next = graph_->chunks[linalg::at(chunk + 1)];
  int place = c.place;
  for (int k = 0; k < kKinds; ++k) {
    for (int i = c.begin[k]; i < next.begin[k]; ++i) {
      visit(graph_->order[linalg::at(place++)], static_cast<Kind>(k), i);
    }
  }
}

}  // namespace tether::contact::detail
