// Tether: an island of several ranks on one of them. SPDX-License-Identifier: BSD-3-Clause
#include "ranks/gathered_island.hpp"

#include <algorithm>
#include <map>

namespace tether::contact::detail {

using linalg::at;

namespace {

// Numbers of a contact: its number, bodies, geometry, mu, bias, slip, state; of a body: its number,
// mass, inertia, velocities.
constexpr std::size_t kContact = 21, kBody = 17;

class Writer {
 public:
  explicit Writer(std::vector<double>& out) : out_(out) {}
  void number(double x) { out_.push_back(x); }
  template <class Derived>
  void all(const Eigen::MatrixBase<Derived>& m) {
    for (Eigen::Index k = 0; k < m.size(); ++k) out_.push_back(m(k % m.rows(), k / m.rows()));
  }

 private:
  std::vector<double>& out_;
};

class Reader {
 public:
  explicit Reader(const double* in) : in_(in) {}
  double number() { return *in_++; }
  int integer() { return static_cast<int>(number()); }
  template <class Derived>
  void all(Eigen::MatrixBase<Derived>& m) {
    for (Eigen::Index k = 0; k < m.size(); ++k) m(k % m.rows(), k / m.rows()) = number();
  }

 private:
  const double* in_;
};

}  // namespace

GatheredIsland::GatheredIsland(const RankPlan& plan, int island, const GivenProblem& given,
                               const IslandSweeps& sweeps, RankMessages& messages, int root) {
  pack(plan, island, given, sweeps);
  std::vector<double> sizes(at(plan.ranks), 0), all;
  sizes[at(plan.rank)] = static_cast<double>(mine_.size());
  messages.sum(sizes);
  std::vector<int> counts;
  for (double size : sizes) counts.push_back(static_cast<int>(size));
  messages.gather(root, mine_, counts, all);
  if (plan.rank == root) unpack(plan, island, all);
}

// The number of contacts, these, the number of bodies, these: some bodies come from several ranks.
void GatheredIsland::pack(const RankPlan& plan, int k, const GivenProblem& given,
                          const IslandSweeps& sweeps) {
  Writer out(mine_);
  std::vector<char> used(given.bodies().size(), 0);
  const auto number = [&](int body) {
    if (body < 0) return -1.0;
    used[at(body)] = 1;
    return static_cast<double>(plan.bodies[at(body)]);
  };
  const Island& mine = plan.part.islands[at(k)];
  out.number(0);  // contacts, when they are counted
  sweeps.for_contacts(mine, [&](int contact, Kind kind, int place) {
    const PointContact& c = given.contact(contact);
    ++mine_[0];
    out.number(plan.contacts[at(contact)]);
    out.number(number(c.first));
    out.number(number(c.second));
    out.all(c.r1);
    out.all(c.r2);
    out.all(c.normal);
    out.number(c.mu);
    out.number(c.bias);
    out.all(c.slip);
    out.all(sweeps.state(kind, place));
  });
  const auto bodies_here = std::count(used.begin(), used.end(), 1);
  out.number(static_cast<double>(bodies_here));
  for (std::size_t b = 0; b < used.size(); ++b) {
    if (!used[b]) continue;
    const RigidBody& body = given.bodies()[b];
    out.number(plan.bodies[b]);
    out.number(body.inverse_mass);
    out.all(body.inverse_inertia);
    out.all(body.velocity);
    out.all(body.angular_velocity);
  }
}

void GatheredIsland::unpack(const RankPlan& plan, int k, const std::vector<double>& all) {
  std::vector<int> numbers, body_numbers, chunks;
  std::vector<char> wanted(plan.whole.chunks.size(), 0);
  const Island& island = plan.whole.islands[at(k)];
  for (int c = island.chunk_begin; c < island.chunk_end; ++c) wanted[at(c)] = 1;
  select_chunks(plan.whole, plan.first, plan.second, wanted,
                {graph, numbers, body_numbers, chunks});
  std::map<int, int> place_of, local;
  for (std::size_t i = 0; i < numbers.size(); ++i) place_of[numbers[i]] = static_cast<int>(i);
  for (std::size_t s = 0; s < body_numbers.size(); ++s)
    local[body_numbers[s]] = static_cast<int>(s);
  contacts.resize(numbers.size());
  states.resize(numbers.size());
  bodies.resize(body_numbers.size());
  const double *next = all.data(), *end = all.data() + all.size();
  while (next < end) {
    std::size_t left = static_cast<std::size_t>(*next++);
    for (; left > 0; --left, next += kContact) {
      Reader in(next);
      const int place = place_of.at(in.integer());
      PointContact& c = contacts[at(place)];
      c.first = in.integer();
      c.second = in.integer();
      in.all(c.r1);
      in.all(c.r2);
      in.all(c.normal);
      c.mu = in.number();
      c.bias = in.number();
      in.all(c.slip);
      in.all(states[at(place)]);
    }
    std::size_t count = static_cast<std::size_t>(*next++);
    for (; count > 0; --count, next += kBody) {
      Reader in(next);
      const int number = in.integer();
      const auto [found, added] = local.emplace(number, static_cast<int>(bodies.size()));
      if (added) {
        bodies.emplace_back();
        graph.slot.push_back(-1);
      }
      RigidBody& body = bodies[at(found->second)];
      body.inverse_mass = in.number();
      in.all(body.inverse_inertia);
      in.all(body.velocity);
      in.all(body.angular_velocity);
    }
  }
  for (PointContact& c : contacts) {
    c.first = local.at(c.first);
    if (c.second >= 0) c.second = local.at(c.second);
  }
}

}  // namespace tether::contact::detail
