// Tether: processes that share the solves of what they all have. SPDX-License-Identifier:
// BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <exception>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tether/contact/ranks.hpp>
#include <tether/linalg/index.hpp>

#include "body_sweeps/implementation.hpp"
#include "ranks/rank_plan.hpp"

namespace tether::contact {

using detail::Island;
using detail::IslandResult;
using detail::PassResult;
using detail::RankExchange;
using detail::RankExchanges;
using Eigen::Vector3d;
using linalg::at;

namespace {

// Numbers that are gathered.
constexpr int kReport = 6, kOfContact = 5;
constexpr int kOfBody = Vector6d::SizeAtCompileTime, kOfState = Eigen::Vector4d::SizeAtCompileTime;

// The part, 0 .. parts - 1, of each position: recursive bisection across the longest side, with
// about the same work in each part.
std::vector<int> bisect(const std::vector<Vector3d>& positions, const std::vector<double>& work,
                        int parts) {
  std::vector<int> order(positions.size()), out(positions.size());
  const auto cut = [&](const auto& again, auto begin, auto end, int first, int count) -> void {
    if (count == 1 || begin == end) {
      for (auto k = begin; k != end; ++k) out[at(*k)] = first;
      return;
    }
    Eigen::AlignedBox3d box;
    double all = 0;
    for (auto k = begin; k != end; ++k) {
      box.extend(positions[at(*k)]);
      all += work[at(*k)];
    }
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    std::sort(begin, end, [&](int a, int b) {
      const double u = positions[at(a)][axis], v = positions[at(b)][axis];
      return u != v ? u < v : a < b;
    });
    const int half = count / 2;
    double sum = 0;
    auto middle = begin;
    while (middle != end && sum * count < all * half) sum += work[at(*middle++)];
    again(again, begin, middle, first, half);
    again(again, middle, end, first + half, count - half);
  };
  std::iota(order.begin(), order.end(), 0);
  cut(cut, order.begin(), order.end(), 0, parts);
  return out;
}

}  // namespace

// The part of this process in BodySolver's sweeps over the whole problem.
struct RankTeam::Implementation final : detail::SweepPartners {
  Implementation(RankMessages& m, int fewest) : messages(m), smallest(fewest) {}

  bool here(int island) const override { return plan.here[at(island)] != 0; }
  bool shared(int island) const override { return plan.shared[at(island)] != 0; }
  bool reports(int island) const override { return root(island) == plan.rank; }
  const detail::ContactGraph& whole() const override { return plan.whole; }
  void begin(int island) override { island_now = island; }
  void after_colour(int colour, detail::MovingBodies& bodies) override {
    pass_on(plan.after[at(colour)], after[at(colour)], bodies);
  }
  void share(detail::MovingBodies& bodies) override {
    pass_on(plan.share[at(island_now)], between[at(island_now)], bodies);
  }
  PassResult total(const std::vector<PassResult>& sums) override;
  void finish(bool failed) override;
  void give_up(const char* why) override { messages.give_up(why); }

  using With = std::vector<RankMessages::With>;
  static With buffers(const RankExchanges& exchanges);
  void pass_on(const RankExchanges& exchanges, With& with, detail::MovingBodies& bodies);
  int root(int island) const {
    return plan.chunk_rank[at(plan.whole.islands[at(island)].chunk_begin)];
  }

  void find_owners(std::size_t bodies);
  void make_plan(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts);
  void solve_part(BodySolution& out);
  bool any_failed(bool failed);
  void gather_states(int island, std::vector<Eigen::Vector4d>& states);
  void assemble(int island, const std::vector<Eigen::Vector4d>& states);
  void pack(const BodySolution& out);
  void exchange();
  void unpack(BodySolution& out);
  bool is_moved(std::size_t body) const { return plan.whole.slot[body] >= 0; }

  RankMessages& messages;
  int smallest;
  detail::RankPlan plan;
  BodySolver::Implementation engine;
  std::vector<With> after, between;  // by colour, by island
  int island_now = 0;

  std::vector<Vector3d> positions;
  int places = 0;
  std::vector<int> owner;  // of bodies: by the positions, or by number
  bool owned_by_place = false;
  long problems = 0, swept = 0;

  // Data of a solve:
  detail::Worker worker;
  std::vector<char> replaced;  // contacts
  std::vector<double> sums, mine, all;
};

RankTeam::Implementation::With RankTeam::Implementation::buffers(const RankExchanges& exchanges) {
  With out;
  for (const RankExchange& e : exchanges)
    out.push_back({e.rank, std::vector<double>(6 * e.send.size()),
                   std::vector<double>(6 * e.receive.size())});
  return out;
}

void RankTeam::Implementation::pass_on(const RankExchanges& exchanges, With& with,
                                       detail::MovingBodies& bodies) {
  if (with.empty()) return;
  for (std::size_t k = 0; k < with.size(); ++k) {
    double* out = with[k].out.data();
    for (const int slot : exchanges[k].send) bodies.get(slot, out), out += 6;
  }
  messages.exchange(with);
  for (std::size_t k = 0; k < with.size(); ++k) {
    const double* in = with[k].in.data();
    for (const int slot : exchanges[k].receive) bodies.set(slot, in), in += 6;
  }
}

// In the order of the chunks of the whole, as one process adds them.
PassResult RankTeam::Implementation::total(const std::vector<PassResult>& of_chunks) {
  const Island &whole = plan.whole.islands[at(island_now)],
               &part = plan.part.islands[at(island_now)];
  sums.assign(4 * at(whole.chunk_end - whole.chunk_begin), 0);
  for (int c = part.chunk_begin; c < part.chunk_end; ++c) {
    const PassResult& r = of_chunks[at(c)];
    const auto place = 4 * (plan.chunk_of[at(c)] - whole.chunk_begin);
    std::copy_n(std::array{r.sum, r.most, r.speed, r.started}.begin(), 4, sums.begin() + place);
  }
  messages.sum(sums);
  PassResult total;
  for (std::size_t c = 0; c < sums.size(); c += 4) {
    PassResult r(detail::Squares{sums[c], sums[c + 1]});
    r.speed = sums[c + 2];
    r.started = sums[c + 3];
    total.add(r);
  }
  return total;
}

void RankTeam::Implementation::find_owners(std::size_t bodies) {
  const bool placed = positions.size() == bodies;
  if (placed && owned_by_place && owner.size() == bodies) return;
  owner.resize(bodies);
  owned_by_place = placed;
  if (!placed) {
    for (std::size_t k = 0; k < bodies; ++k)
      owner[k] = static_cast<int>(k * at(messages.size()) / bodies);
    return;
  }
  std::vector<double> work(bodies, 1);
  for (std::size_t i = 0; i < engine.given.first().size(); ++i) {
    const int one = engine.given.first()[i], other = engine.given.second()[i];
    ++work[at(other < 0 ? one : std::min(one, other))];
  }
  owner = bisect(positions, work, messages.size());
}

// All ranks plan the whole graph of contacts alike, so that it needs no messages.
void RankTeam::Implementation::make_plan(const std::vector<RigidBody>& bodies,
                                         const std::vector<PointContact>& contacts) {
  engine.given.read(bodies, contacts, engine.options.law);
  find_owners(bodies.size());
  plan.build(engine.given.first(), engine.given.second(), engine.given.kinds(), owner,
             messages.size(), messages.rank());
  after.clear();
  between.clear();
  for (const RankExchanges& e : plan.after) after.push_back(buffers(e));
  for (const RankExchanges& e : plan.share) between.push_back(buffers(e));
}

bool RankTeam::Implementation::any_failed(bool failed) {
  std::vector<double> failures(at(messages.size()), 0);
  failures[at(messages.rank())] = failed;
  messages.sum(failures);
  return std::any_of(failures.begin(), failures.end(), [](double f) { return f != 0; });
}

void RankTeam::Implementation::solve_part(BodySolution& out) {
  engine.out = &out;
  engine.graph = plan.part;
  engine.partners = this;
  worker.replaced.clear();
  std::exception_ptr failure;
  try {
    engine.solve_graph();
  } catch (...) {
    failure = std::current_exception();
  }
  const bool any = any_failed(failure != nullptr);
  if (failure) std::rethrow_exception(failure);
  if (any) throw std::runtime_error("another rank could not solve its contacts");
  replaced.assign(engine.given.contacts().size(), 0);
  for (const std::vector<int>* list : {&out.replaced, &worker.replaced})
    for (const int i : *list) replaced[at(i)] = 1;
}

// Shared islands that are to be assembled are left to the rank of their first chunk. A throw on one
// rank leaves all out of that; solve_part() sees to it that all throw.
void RankTeam::Implementation::finish(bool failed) {
  if (any_failed(failed)) return;
  std::vector<std::pair<int, std::vector<Eigen::Vector4d>>> left;
  for (int k = 0; k < static_cast<int>(plan.shared.size()); ++k) {
    if (!shared(k) || !(engine.results[at(k)].assembly > 0)) continue;
    std::vector<Eigen::Vector4d> states;
    gather_states(k, states);
    const Island& island = plan.whole.islands[at(k)];
    for (int i = 0; i < island.contacts; ++i)
      plan.contact_rank[at(plan.whole.order[at(island.contact_begin + i)])] = root(k);
    for (int s = island.body_begin; s < island.body_end; ++s)
      plan.home[at(plan.whole.body[at(s)])] = root(k);
    if (reports(k)) left.emplace_back(k, std::move(states));
  }
  if (left.empty()) return;
  engine.graph = plan.whole;
  engine.sweeps.start(engine.given, engine.graph, engine.options.law);
  for (const auto& [island, states] : left) assemble(island, states);
}

// States of the contacts of an island after its sweeps, in the order of its places; on its root.
void RankTeam::Implementation::gather_states(int k, std::vector<Eigen::Vector4d>& states) {
  const Island& island = plan.whole.islands[at(k)];
  std::vector<int> counts(at(plan.ranks), 0);
  for (int c = island.chunk_begin; c < island.chunk_end; ++c)
    counts[at(plan.chunk_rank[at(c)])] += kOfState * plan.count(c);
  mine.clear();
  engine.sweeps.for_contacts(plan.part.islands[at(k)], [&](int, detail::Kind kind, int place) {
    const Eigen::Vector4d s = engine.sweeps.state(kind, place);
    mine.insert(mine.end(), s.data(), s.data() + kOfState);
  });
  messages.gather(root(k), mine, counts, all);
  if (!reports(k)) return;
  std::vector<const double*> next;
  const double* from = all.data();
  for (const int count : counts) next.push_back(from), from += count;
  for (int c = island.chunk_begin; c < island.chunk_end; ++c)
    for (int i = 0; i < plan.count(c); ++i, next[at(plan.chunk_rank[at(c)])] += kOfState)
      states.push_back(Eigen::Map<const Eigen::Vector4d>(next[at(plan.chunk_rank[at(c)])]));
}

// As one process would, from where the sweeps are.
void RankTeam::Implementation::assemble(int k, const std::vector<Eigen::Vector4d>& states) {
  const Island& island = plan.whole.islands[at(k)];
  detail::Team team{0, 1, nullptr, &worker.scratch};
  engine.sweeps.load(island, team);
  engine.sweeps.pack(island, team, {});
  auto next = states.begin();
  engine.sweeps.for_contacts(island, [&](int, detail::Kind kind, int place) {
    engine.sweeps.set_state(kind, place, *next++);
  });
  engine.assemble_and_sweep_on(k, worker);
}

// Packs the results of this rank in the order of unpack().
void RankTeam::Implementation::pack(const BodySolution& out) {
  mine.clear();
  for (const int number : {static_cast<int>(out.status), out.sweeps, out.colours,
                           out.assembled_islands, out.failed_islands})
    mine.push_back(number);
  mine.push_back(out.error);
  const auto put = [&](const Vector3d& v) { mine.insert(mine.end(), v.data(), v.data() + 3); };
  for (std::size_t i = 0; i < replaced.size(); ++i) {
    if (plan.contact_rank[i] != plan.rank) continue;
    put(out.impulses[i]);
    mine.push_back(static_cast<double>(out.regimes[i]));
    mine.push_back(replaced[i]);
  }
  for (std::size_t b = 0; b < plan.home.size(); ++b) {
    if (!is_moved(b) || plan.home[b] != plan.rank) continue;
    put(out.velocities[b]);
    put(out.angular_velocities[b]);
  }
}

// Numbers as they are, not sums: signs of zeros stay.
void RankTeam::Implementation::exchange() {
  std::vector<int> counts(at(messages.size()), kReport);
  for (const int r : plan.contact_rank) counts[at(r)] += kOfContact;
  for (std::size_t b = 0; b < plan.home.size(); ++b)
    if (is_moved(b)) counts[at(plan.home[b])] += kOfBody;
  all.resize(at(std::accumulate(counts.begin(), counts.end(), 0)));
  messages.gather(0, mine, counts, all);
  messages.broadcast(0, all);
}

// Bodies that no contact moves have their velocities already.
void RankTeam::Implementation::unpack(BodySolution& out) {
  out.status = Status::solved;
  out.error = 0;
  out.sweeps = out.colours = out.assembled_islands = out.failed_islands = 0;
  out.replaced.clear();
  const std::vector<detail::Kind>& kinds = engine.given.kinds();
  out.spheres = std::find(kinds.begin(), kinds.end(), detail::Kind::general) == kinds.end();
  const double* from = all.data();
  for (int r = 0; r < messages.size(); ++r) {
    const auto number = [&] { return static_cast<int>(*from++); };
    out.status = worse(out.status, static_cast<Status>(number()));
    out.sweeps = std::max(out.sweeps, number());
    out.colours = std::max(out.colours, number());
    out.assembled_islands += number();
    out.failed_islands += number();
    out.error = worse(out.error, *from++);
    const auto get = [&](Vector3d& v) {
      v = Eigen::Map<const Vector3d>(from);
      from += 3;
    };
    for (std::size_t i = 0; i < replaced.size(); ++i) {
      if (plan.contact_rank[i] != r) continue;
      get(out.impulses[i]);
      out.regimes[i] = static_cast<Regime>(number());
      if (*from++ != 0) out.replaced.push_back(static_cast<int>(i));
    }
    for (std::size_t b = 0; b < plan.home.size(); ++b) {
      if (!is_moved(b) || plan.home[b] != r) continue;
      get(out.velocities[b]);
      get(out.angular_velocities[b]);
    }
  }
  std::sort(out.replaced.begin(), out.replaced.end());
}

RankTeam::RankTeam(RankMessages& messages, int smallest)
    : implementation_(std::make_unique<Implementation>(messages, smallest)) {}
RankTeam::~RankTeam() = default;

void RankTeam::place(const std::vector<Vector3d>& positions) {
  Implementation& own = *implementation_;
  // Parts are cut anew at every twentieth call.
  if (own.places++ % 20 != 0 && positions.size() == own.positions.size()) return;
  own.positions = positions;
  own.owned_by_place = false;
}

bool RankTeam::solve(const std::vector<RigidBody>& bodies,
                     const std::vector<PointContact>& contacts,
                     const std::vector<const Vector3d*>& starts, const BodyOptions& options,
                     BodySolution& solution) {
  Implementation& own = *implementation_;
  if (own.messages.size() == 1 || static_cast<int>(contacts.size()) < own.smallest) return false;
  own.engine.options = options;
  own.engine.starts = starts;
  own.make_plan(bodies, contacts);
  own.solve_part(solution);
  own.pack(solution);
  own.exchange();
  own.unpack(solution);
  ++own.problems;
  own.swept += static_cast<long>(own.plan.part.order.size());
  return true;
}

long RankTeam::problems() const { return implementation_->problems; }
long RankTeam::swept_contacts() const { return implementation_->swept; }

}  // namespace tether::contact
