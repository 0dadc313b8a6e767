// Tether: the part of one rank of BodySolver. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <exception>
#include <stdexcept>
#include <string>
#include <tether/contact/ranks.hpp>
#include <tether/linalg/index.hpp>

#include "body_sweeps/implementation.hpp"
#include "problem/refuse.hpp"
#include "ranks/gathered_island.hpp"
#include "ranks/rank_part.hpp"

namespace tether::contact {

using linalg::at;

struct RankSolver::Implementation final : detail::RankPart {
  Implementation() : RankPart(plan) {}
  void finish(bool failed) override;
  bool assemble(int island);
  void solve(int island, const detail::GatheredIsland& all, detail::IslandAnswer& answer) const;
  void take(int island, const detail::IslandAnswer& answer);
  void refuse_sizes(std::size_t bodies, std::size_t contacts, std::size_t starts) const;

  detail::RankPlan plan;
  BodySolver solver;  // of the part
  BodySolver::Implementation& engine = *solver.implementation_;
  std::vector<int> replaced;  // contacts here, of shared islands
};

RankSolver::RankSolver(const BodyOptions& options) : implementation_(new Implementation) {
  set_options(options);
}
RankSolver::~RankSolver() = default;
RankSolver::RankSolver(RankSolver&&) noexcept = default;
RankSolver& RankSolver::operator=(RankSolver&&) noexcept = default;

const BodyOptions& RankSolver::options() const { return implementation_->solver.options(); }
void RankSolver::set_options(const BodyOptions& options) {
  implementation_->solver.set_options(options);
}

const std::vector<int>& RankSolver::contacts() const { return implementation_->plan.contacts; }
const std::vector<int>& RankSolver::bodies() const { return implementation_->plan.bodies; }
const std::vector<int>& RankSolver::contact_ranks() const {
  return implementation_->plan.contact_rank;
}
const std::vector<int>& RankSolver::body_ranks() const { return implementation_->plan.home; }

void RankSolver::plan(const std::vector<RankContact>& contacts, const std::vector<int>& owner,
                      int ranks, int rank) {
  implementation_->plan.build(contacts, owner, ranks, rank);
}

RankTraffic RankSolver::traffic() const {
  const detail::RankPlan& plan = implementation_->plan;
  RankTraffic out;
  const auto add = [](const std::vector<int>& slots, long long& messages, long long& velocities) {
    messages += !slots.empty();
    velocities += static_cast<long long>(slots.size());
  };
  for (const detail::RankExchanges& colour : plan.after)
    for (const detail::RankExchange& e : colour) add(e.send, out.messages, out.velocities);
  for (std::size_t k = 0; k < plan.share.size(); ++k) {
    for (const detail::RankExchange& e : plan.share[k])
      add(e.send, out.look_messages, out.look_velocities);
    const detail::Island& island = plan.whole.islands[k];
    if (plan.shared[k]) out.sums += 3 * (island.chunk_end - island.chunk_begin);
  }
  return out;
}

// A shared island is counted by the rank of its first chunk.
RankIslands RankSolver::islands() const {
  const Implementation& own = *implementation_;
  RankIslands out;
  out.all = static_cast<int>(own.plan.shared.size());
  for (std::size_t k = 0; k < own.plan.shared.size(); ++k) {
    out.shared += own.plan.shared[k];
    const int first = own.plan.whole.islands[k].chunk_begin;
    if (own.plan.chunk_rank[at(first)] != own.plan.rank) continue;
    out.assembled += own.engine.results[k].assembled;
    out.failed += own.engine.results[k].status != Status::solved;
  }
  return out;
}

void RankSolver::Implementation::refuse_sizes(std::size_t bodies, std::size_t contacts,
                                              std::size_t starts) const {
  const auto check = [](const char* what, std::size_t n, std::size_t needed) {
    if (n == needed) return;
    throw std::invalid_argument(std::string(what) + " has " + std::to_string(n) + " entries: " +
                                std::to_string(needed) + " are needed, as the plan says");
  };
  check("bodies", bodies, plan.bodies.size());
  check("contacts", contacts, plan.contacts.size());
  if (starts > 0) check("starts", starts, plan.contacts.size());
}

void RankSolver::solve(const std::vector<RigidBody>& bodies,
                       const std::vector<PointContact>& contacts,
                       const std::vector<Eigen::Vector3d>& starts, RankMessages& messages,
                       BodySolution& solution) {
  Implementation& own = *implementation_;
  own.refuse_sizes(bodies.size(), contacts.size(), starts.size());
  BodySolver::Implementation& engine = own.engine;
  engine.out = &solution;
  engine.given.read(bodies, contacts, options().law);
  engine.starts.clear();
  for (const Eigen::Vector3d& p : starts) engine.starts.push_back(&p);
  engine.graph = own.plan.part;
  own.start(messages);
  own.replaced.clear();
  engine.partners = &own;
  engine.solve_graph();
  solution.replaced.insert(solution.replaced.end(), own.replaced.begin(), own.replaced.end());
  std::sort(solution.replaced.begin(), solution.replaced.end());
}

// A throw on one rank leaves all out of what follows; the caller sees to it that all throw.
void RankSolver::Implementation::finish(bool failed) {
  std::vector<double> failures(at(plan.ranks), 0);
  failures[at(plan.rank)] = failed;
  messages().sum(failures);
  for (double f : failures)
    if (f != 0) return;
  for (int k = 0; k < static_cast<int>(plan.shared.size()); ++k)
    if (plan.shared[at(k)] && engine.results[at(k)].assembly > 0 && !assemble(k)) return;
}

// On the rank that has the first chunk. False: it could not, and throws.
bool RankSolver::Implementation::assemble(int k) {
  const detail::Island& island = plan.whole.islands[at(k)];
  const int root = plan.chunk_rank[at(island.chunk_begin)];
  const detail::GatheredIsland all(plan, k, engine.given, engine.sweeps, messages(), root);
  detail::IslandAnswer answer(island);
  std::exception_ptr failure;
  if (plan.rank == root) {
    try {
      solve(k, all, answer);
    } catch (...) {
      failure = std::current_exception();
      answer.values[0] = -1;
    }
  }
  messages().broadcast(root, answer.values);
  if (failure) std::rethrow_exception(failure);
  if (answer.values[0] < 0) return false;
  take(k, answer);
  return true;
}

// As one process would, from where the sweeps are.
void RankSolver::Implementation::solve(int k, const detail::GatheredIsland& all,
                                       detail::IslandAnswer& answer) const {
  const BodyOptions& options = solver.options();
  BodySolver solver_of_all(options);
  BodySolver::Implementation& one = *solver_of_all.implementation_;
  BodySolution found;
  found.impulses.resize(all.contacts.size());
  found.regimes.resize(all.contacts.size());
  found.velocities.resize(all.bodies.size());
  found.angular_velocities.resize(all.bodies.size());
  one.out = &found;
  one.given.read(all.bodies, all.contacts, options.law);
  one.graph = all.graph;
  one.results = engine.results;
  one.sweeps.start(one.given, one.graph, options.law);
  const detail::Island& island = one.graph.islands[at(k)];
  detail::Worker worker;
  detail::Team team{0, 1, nullptr, &worker.scratch};
  one.sweeps.load(island, team);
  one.sweeps.pack(island, team, {});
  one.sweeps.for_contacts(island, [&](int contact, detail::Kind kind, int place) {
    one.sweeps.set_state(kind, place, all.states[at(contact)]);
  });
  one.assemble_and_sweep_on(k, worker);
  answer.values[0] = static_cast<double>(one.results[at(k)].status);
  answer.values[1] = one.results[at(k)].error;
  for (int i = 0; i < island.contacts; ++i) {
    Eigen::Map<Eigen::Vector3d>(answer.contact(i)) = found.impulses[at(i)];
    answer.contact(i)[3] = static_cast<double>(found.regimes[at(i)]);
  }
  for (int contact : worker.replaced) answer.contact(contact)[4] = 1;
  for (int s = 0; s < island.body_end - island.body_begin; ++s) {
    Eigen::Map<Eigen::Vector3d>(answer.body(s)) = found.velocities[at(s)];
    Eigen::Map<Eigen::Vector3d>(answer.body(s) + 3) = found.angular_velocities[at(s)];
  }
}

void RankSolver::Implementation::take(int k, const detail::IslandAnswer& answer) {
  const detail::Island &all = plan.whole.islands[at(k)], &mine = plan.part.islands[at(k)];
  detail::IslandResult& r = engine.results[at(k)];
  r.status = static_cast<Status>(answer.values[0]);
  r.error = answer.values[1];
  r.assembled = r.saved = true;
  BodySolution& out = *engine.out;
  for (int c = mine.chunk_begin; c < mine.chunk_end; ++c) {
    const int from = plan.whole.chunks[at(plan.chunk_of[at(c)])].place - all.contact_begin;
    const int begin = plan.part.chunks[at(c)].place, end = plan.part.chunks[at(c + 1)].place;
    for (int place = begin; place < end; ++place) {
      const double* x = answer.contact(from + place - begin);
      const std::size_t contact = at(plan.part.order[at(place)]);
      out.impulses[contact] = Eigen::Map<const Eigen::Vector3d>(x);
      out.regimes[contact] = static_cast<Regime>(x[3]);
      if (x[4] != 0) replaced.push_back(static_cast<int>(contact));
    }
  }
  for (int s = mine.body_begin; s < mine.body_end; ++s) {
    const int slot = plan.whole.slot[at(plan.bodies[at(s)])] - all.body_begin;
    out.velocities[at(s)] = Eigen::Map<const Eigen::Vector3d>(answer.body(slot));
    out.angular_velocities[at(s)] = Eigen::Map<const Eigen::Vector3d>(answer.body(slot) + 3);
  }
}

}  // namespace tether::contact
