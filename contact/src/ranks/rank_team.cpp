// Tether: processes that share the solves of what they all have. SPDX-License-Identifier:
// BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <exception>
#include <stdexcept>
#include <string>
#include <tether/contact/ranks.hpp>
#include <tether/linalg/index.hpp>

#include "graph/graph_parts.hpp"

namespace tether::contact {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr int kPlaces = 20;  // parts are cut anew at every so many of them
constexpr int kReport = 7, kOfContact = 5, kOfBody = 6;  // numbers that are gathered

// Bodies of a list to ranks first .. first + ranks - 1: in two parts with the work of their ranks,
// cut across the longest side, and so on. The same on all processes, which is all that is asked.
class Bisection {
 public:
  Bisection(const std::vector<Vector3d>& positions, const std::vector<double>& work,
            std::vector<int>& owner)
      : x_(positions), work_(work), owner_(owner) {}

  void cut(std::vector<int>::iterator begin, std::vector<int>::iterator end, int first, int ranks) {
    if (ranks == 1 || begin == end) {
      for (auto k = begin; k != end; ++k) owner_[at(*k)] = first;
      return;
    }
    Eigen::AlignedBox3d box;
    double all = 0;
    for (auto k = begin; k != end; ++k) {
      box.extend(x_[at(*k)]);
      all += work_[at(*k)];
    }
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    std::sort(begin, end, [&](int a, int b) {
      const double u = x_[at(a)][axis], v = x_[at(b)][axis];
      return u != v ? u < v : a < b;
    });
    const int half = ranks / 2;
    double part = 0;
    auto middle = begin;
    while (middle != end && part * ranks < all * half) part += work_[at(*middle++)];
    cut(begin, middle, first, half);
    cut(middle, end, first + half, ranks - half);
  }

 private:
  const std::vector<Vector3d>& x_;
  const std::vector<double>& work_;
  std::vector<int>& owner_;
};

}  // namespace

struct RankTeam::Implementation {
  Implementation(RankMessages& m, int fewest) : messages(m), smallest(fewest), ranks({}) {}

  void plan(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
            const BodyOptions& options);
  void find_owners(int bodies);
  void take_part(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
                 const std::vector<const Vector3d*>& starts);
  void solve_part();
  void pack();
  void exchange();
  void unpack(const std::vector<RigidBody>& bodies, BodySolution& out);

  RankMessages& messages;
  int smallest;
  RankSolver ranks;
  std::vector<Vector3d> positions;
  int places = 0;
  std::vector<int> owner;  // of the positions, or of the bodies of a solve without
  bool owners_by_place = false;
  long problems = 0, swept = 0;
  // Data of a solve:
  std::vector<std::uint8_t> traits;
  std::vector<RankContact> links;
  std::vector<char> moved;  // by a contact
  std::vector<int> local;   // body -> place in the part
  std::vector<RigidBody> part_bodies;
  std::vector<PointContact> part_contacts;
  std::vector<Vector3d> part_starts;
  BodySolution found;
  std::vector<double> mine, all;
};

void RankTeam::Implementation::find_owners(int bodies) {
  const bool placed = static_cast<int>(positions.size()) == bodies;
  if (placed && owners_by_place && static_cast<int>(owner.size()) == bodies) return;
  owner.resize(at(bodies));
  owners_by_place = placed;
  if (!placed) {
    for (int k = 0; k < bodies; ++k)
      owner[at(k)] = static_cast<int>(static_cast<long>(k) * messages.size() / bodies);
    return;
  }
  std::vector<double> work(at(bodies), 1);
  for (const RankContact& c : links)
    ++work[at(c.second < 0 ? c.first : std::min(c.first, c.second))];
  std::vector<int> order(at(bodies));
  for (int k = 0; k < bodies; ++k) order[at(k)] = k;
  Bisection(positions, work, owner).cut(order.begin(), order.end(), 0, messages.size());
}

void RankTeam::Implementation::plan(const std::vector<RigidBody>& bodies,
                                    const std::vector<PointContact>& contacts,
                                    const BodyOptions& options) {
  BodyOptions of_ranks = options;
  of_ranks.team = nullptr;
  of_ranks.warm_start = false;
  ranks.set_options(of_ranks);
  traits.resize(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) traits[k] = rank_traits(k, bodies[k]);
  links.resize(contacts.size());
  moved.assign(bodies.size(), 0);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    links[i] = rank_contact(i, contacts[i], traits, options.law);
    for (const int b : {links[i].first, links[i].second})
      if (b >= 0) moved[at(b)] = 1;
  }
  find_owners(static_cast<int>(bodies.size()));
  ranks.plan(links, owner, messages.size(), messages.rank());
}

void RankTeam::Implementation::take_part(const std::vector<RigidBody>& bodies,
                                         const std::vector<PointContact>& contacts,
                                         const std::vector<const Vector3d*>& starts) {
  local.assign(bodies.size(), -1);
  part_bodies.clear();
  for (const int b : ranks.bodies()) {
    local[at(b)] = static_cast<int>(part_bodies.size());
    part_bodies.push_back(bodies[at(b)]);
  }
  part_contacts.clear();
  part_starts.clear();
  for (const int i : ranks.contacts()) {
    PointContact c = contacts[at(i)];
    c.first = local[at(c.first)];
    if (c.second >= 0) c.second = local[at(c.second)];
    part_contacts.push_back(c);
    if (!starts.empty()) part_starts.push_back(starts[at(i)] ? *starts[at(i)] : Vector3d(0, 0, 0));
  }
}

void RankTeam::Implementation::solve_part() {
  std::exception_ptr failure;
  try {
    ranks.solve(part_bodies, part_contacts, part_starts, messages, found);
  } catch (...) {
    failure = std::current_exception();
  }
  std::vector<double> failed(at(messages.size()), 0);
  failed[at(messages.rank())] = failure != nullptr;
  messages.sum(failed);
  if (failure) std::rethrow_exception(failure);
  for (std::size_t r = 0; r < failed.size(); ++r)
    if (failed[r] != 0)
      throw std::runtime_error("rank " + std::to_string(r) + " could not solve its contacts");
}

// Packs the results of this rank in the order of unpack().
void RankTeam::Implementation::pack() {
  const int me = messages.rank();
  const RankIslands islands = ranks.islands();
  mine.clear();
  for (const int number : {static_cast<int>(found.status), found.sweeps, found.colours, islands.all,
                           islands.assembled, islands.failed})
    mine.push_back(number);
  mine.push_back(found.error);
  const auto put = [&](const Vector3d& v) { mine.insert(mine.end(), v.data(), v.data() + 3); };
  std::vector<double> replaced(part_contacts.size(), 0);
  for (const int i : found.replaced) replaced[at(i)] = 1;
  std::vector<int> place(links.size(), -1);
  for (std::size_t k = 0; k < ranks.contacts().size(); ++k)
    place[at(ranks.contacts()[k])] = static_cast<int>(k);
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (ranks.contact_ranks()[i] != me) continue;
    const std::size_t k = at(place[i]);
    put(found.impulses[k]);
    mine.push_back(static_cast<double>(found.regimes[k]));
    mine.push_back(replaced[k]);
  }
  for (std::size_t b = 0; b < moved.size(); ++b) {
    if (!moved[b] || ranks.body_ranks()[b] != me) continue;
    put(found.velocities[at(local[b])]);
    put(found.angular_velocities[at(local[b])]);
  }
}

// Numbers as they are, not sums: signs of zeros stay.
void RankTeam::Implementation::exchange() {
  std::vector<int> counts(at(messages.size()), kReport);
  for (const int r : ranks.contact_ranks()) counts[at(r)] += kOfContact;
  for (std::size_t b = 0; b < moved.size(); ++b)
    if (moved[b]) counts[at(ranks.body_ranks()[b])] += kOfBody;
  std::size_t sum = 0;
  for (const int count : counts) sum += at(count);
  all.resize(sum);
  messages.gather(0, mine, counts, all);
  messages.broadcast(0, all);
}

void RankTeam::Implementation::unpack(const std::vector<RigidBody>& bodies, BodySolution& out) {
  out.status = Status::solved;
  out.error = 0;
  out.sweeps = out.colours = out.assembled_islands = out.failed_islands = 0;
  out.replaced.clear();
  out.impulses.resize(links.size());
  out.regimes.resize(links.size());
  out.velocities.resize(bodies.size());
  out.angular_velocities.resize(bodies.size());
  out.bytes = found.bytes;
  out.body_bytes = found.body_bytes;
  out.spheres = std::none_of(links.begin(), links.end(), [](const RankContact& c) {
    return c.kind == static_cast<std::uint8_t>(detail::Kind::general);
  });
  const double* from = all.data();
  for (int r = 0; r < messages.size(); ++r) {
    const auto number = [&] { return static_cast<int>(*from++); };
    out.status = worse(out.status, static_cast<Status>(number()));
    out.sweeps = std::max(out.sweeps, number());
    out.colours = std::max(out.colours, number());
    out.islands = number();
    out.assembled_islands += number();
    out.failed_islands += number();
    out.error = worse(out.error, *from++);
    const auto get = [&](Vector3d& v) {
      v = Eigen::Map<const Vector3d>(from);
      from += 3;
    };
    for (std::size_t i = 0; i < links.size(); ++i) {
      if (ranks.contact_ranks()[i] != r) continue;
      get(out.impulses[i]);
      out.regimes[i] = static_cast<Regime>(number());
      if (*from++ != 0) out.replaced.push_back(static_cast<int>(i));
    }
    for (std::size_t b = 0; b < moved.size(); ++b) {
      if (!moved[b] || ranks.body_ranks()[b] != r) continue;
      get(out.velocities[b]);
      get(out.angular_velocities[b]);
    }
  }
  std::sort(out.replaced.begin(), out.replaced.end());
  for (std::size_t b = 0; b < moved.size(); ++b) {
    if (moved[b]) continue;
    out.velocities[b] = bodies[b].velocity;
    out.angular_velocities[b] = bodies[b].angular_velocity;
  }
}

RankTeam::RankTeam(RankMessages& messages, int smallest)
    : implementation_(std::make_unique<Implementation>(messages, smallest)) {}
RankTeam::~RankTeam() = default;

void RankTeam::place(const std::vector<Vector3d>& positions) {
  Implementation& own = *implementation_;
  if (own.places++ % kPlaces != 0 && positions.size() == own.positions.size()) return;
  own.positions = positions;
  own.owners_by_place = false;
}

bool RankTeam::solve(const std::vector<RigidBody>& bodies,
                     const std::vector<PointContact>& contacts,
                     const std::vector<const Vector3d*>& starts, const BodyOptions& options,
                     BodySolution& solution) {
  Implementation& own = *implementation_;
  if (own.messages.size() == 1 || static_cast<int>(contacts.size()) < own.smallest) return false;
  own.plan(bodies, contacts, options);
  own.take_part(bodies, contacts, starts);
  own.solve_part();
  own.pack();
  own.exchange();
  own.unpack(bodies, solution);
  ++own.problems;
  own.swept += static_cast<long>(own.part_contacts.size());
  return true;
}

long RankTeam::problems() const { return implementation_->problems; }
long RankTeam::swept_contacts() const { return implementation_->swept; }

}  // namespace tether::contact
