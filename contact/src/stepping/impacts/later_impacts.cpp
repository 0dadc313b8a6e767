// Tether: impacts that impacts cause. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/later_impacts.hpp"

#include <algorithm>
#include <limits>
#include <tether/linalg/index.hpp>
#include <utility>

#include "stepping/impacts/step_energy.hpp"

namespace tether::contact::detail {

namespace {

using linalg::at;

double bias(double gap, double dt) { return gap > 0 ? gap / dt : 0; }

}  // namespace

LaterImpacts::LaterImpacts(double threshold, double restitution_threshold,
                           const BodyOptions& options, IslandMaker* maker,
                           std::unique_ptr<Restitution> restitution)
    : islands_(maker),
      pass_impacts_(threshold, restitution_threshold),
      restitution_(std::move(restitution)),
      solver_(cold(options), maker, LawUse::none) {}

// Marks the islands in which a contact closes only because of an impact, at more than the least
// speed of an impact, so that the solve stopped it at gap / dt. False: there are none.
bool LaterImpacts::find_islands(const NearContacts& near, const Impacts& impacts,
                                const BodySet& bodies, double dt, const StepContacts& contacts) {
  const auto later = [&](std::size_t k) {
    const PointContact& c = contacts.points[k];
    return contacts.gaps[k] > 0 && !contacts.impulses[k].isZero(0) &&
           contacts.gaps[k] > dt * impacts.least_speed(near, c) &&
           !(-normal_velocity(impacts.free(), c) * dt > contacts.gaps[k]);
  };
  bool any = false;
  for (std::size_t k = 0; k < contacts.points.size() && !any; ++k) any = later(k);
  if (!any) return false;
  islands_.join(bodies, contacts);
  const auto root = [&](std::size_t k) { return at(islands_.root(bodies, contacts.points[k])); };
  size_.assign(bodies.motion.size(), 0);
  for (std::size_t k = 0; k < contacts.points.size(); ++k) ++size_[root(k)];
  // 1: an impact; 2: a later one, too.
  marked_.assign(bodies.motion.size(), 0);
  for (const Impact& i : impacts.list())
    if (size_[root(at(i.contact))] <= kFewContacts) marked_[root(at(i.contact))] = 1;
  if (laws_ != nullptr) islands_.mark(laws_->under_laws(), marked_, 0);
  any = false;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (marked_[root(k)] == 0 || !later(k)) continue;
    marked_[root(k)] = 2;
    any = true;
  }
  return any;
}

// From the velocities before the impulses.
void LaterImpacts::start(const NearContacts& near, const Impacts& impacts, double dt,
                         BodySet& bodies, StepContacts& contacts) {
  // Part of the speed of the island's fastest impact: slower approaches are rounding.
  constexpr double kPart = 1e-6;
  fastest_.assign(bodies.motion.size(), 0);
  for (const Impact& i : impacts.list()) {
    double& fastest = fastest_[at(islands_.root(bodies, contacts.points[at(i.contact)]))];
    fastest = std::max(fastest, i.comes);
  }
  members_.clear();
  taken_.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const PointContact& c = contacts.points[k];
    const int root = islands_.root(bodies, c);
    if (marked_[at(root)] != 2) continue;
    const double least = std::max(impacts.least_speed(near, c), kPart * fastest_[at(root)]);
    members_.push_back(
        {static_cast<int>(k), root, least, contacts.gaps[k], 0, contacts.gaps[k] <= dt * least});
    contacts.impulses[k].setZero();
  }
  time_.assign(bodies.motion.size(), 0);
  way_.resize(bodies.motion.size());
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (bodies.mass[i] == 0 || marked_[at(islands_.root(static_cast<int>(i)))] != 2) continue;
    bodies.motion[i].velocity = impacts.free()[i].velocity;
    bodies.motion[i].angular_velocity = impacts.free()[i].angular_velocity;
  }
  pass_impacts_.remember(impacts.coming());
}

// Contacts of a pass. False: nothing closes faster than what counts.
bool LaterImpacts::gather(const BodySet& bodies, double dt, const StepContacts& contacts,
                          bool all) {
  part_.points.clear();
  part_.gaps.clear();
  member_.clear();
  bool any = false;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    Member& m = members_[i];
    const PointContact& c = contacts.points[at(m.contact)];
    m.approach = -normal_velocity(bodies.motion, c);
    const double slowest = bias(m.left, m.touches ? dt : remaining(m, dt));
    any = any || m.approach > slowest + m.least;
    if (!all && !m.touches && !(m.approach > slowest)) continue;
    part_.points.push_back(c);
    part_.points.back().bias = slowest;
    part_.gaps.push_back(m.left);
    member_.push_back(static_cast<int>(i));
  }
  return any;
}

// To the first impact of each island that no impact of the pass bounces in.
void LaterImpacts::pass_time(const StepContacts& contacts) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::fill(way_.begin(), way_.end(), kNone);
  for (const Impact& i : pass_impacts_.list()) {
    const Member& m = members_[at(member_[at(i.contact)])];
    const double way = i.restitution > 0 ? 0 : std::max(m.left, 0.0) / m.approach;
    way_[root(m)] = std::min(way_[root(m)], way);
  }
  for (Member& m : members_)
    if (way_[root(m)] < kNone) m.left -= m.approach * way_[root(m)];
  for (std::size_t i = 0; i < time_.size(); ++i)
    if (way_[i] < kNone) time_[i] += way_[i];
  for (Impact i : pass_impacts_.list()) {
    Member& m = members_[at(member_[at(i.contact)])];
    if (i.restitution == 0) {
      m.touches = true;
      m.left = std::min(m.left, 0.0);
    }
    i.contact = m.contact;
    if (contacts.gaps[at(i.contact)] > 0 || i.restitution > 0) taken_.push_back(i);
  }
}

bool LaterImpacts::solve_pass(const NearContacts& near, const Impacts& impacts, double dt,
                              BodySet& bodies, StepContacts& contacts, Counts& counts) {
  pass_impacts_.choose(near, bodies, dt, part_);
  if (restitution_) restitution_->choose(pass_impacts_, impacts, {}, bodies, part_);
  solver_.solve(bodies.motion, part_.points, solution_);
  ++counts.problems;
  counts.sweeps += solution_.sweeps;
  if (solution_.status != Status::solved) return false;
  take_velocities(solution_, bodies);
  part_.impulses = solution_.impulses;
  bounces_ = restitution_ ? restitution_->apply(bodies, part_) : 0;
  for (std::size_t k = 0; k < member_.size(); ++k)
    contacts.impulses[at(members_[at(member_[k])].contact)] += part_.impulses[k];
  pass_time(contacts);
  return true;
}

bool LaterImpacts::run_passes(const NearContacts& near, const Impacts& impacts, double dt,
                              BodySet& bodies, StepContacts& contacts, Counts& counts) {
  for (int pass = 0; pass < kPasses; ++pass) {
    const bool closing = gather(bodies, dt, contacts, pass == kPasses - 1);
    if (pass > 0 && !closing) break;
    if (!solve_pass(near, impacts, dt, bodies, contacts, counts)) return false;
    if (pass > 0) counts.bounces += bounces_;  // those of the first pass were counted before
    pass_impacts_.remember(bodies);
  }
  return true;
}

// Passes use the positions at the start and move bodies for the whole step, which may add energy.
// Such an island keeps the one solve, which adds none.
void LaterImpacts::keep_energy(const Impacts& impacts, BodySet& bodies, StepContacts& contacts) {
  add_of_forces(impacts, force_);
  gain_.assign(bodies.motion.size(), 0);
  kinetic_.assign(bodies.motion.size(), 0);
  const auto takes_part = [&](std::size_t i) {
    return bodies.mass[i] > 0 && marked_[at(islands_.root(static_cast<int>(i)))] == 2;
  };
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (!takes_part(i)) continue;
    const std::size_t r = at(islands_.root(static_cast<int>(i)));
    gain_[r] += kinetic_gain(bodies, i, bodies.motion[i], impacts.coming()[i]) -
                work(bodies, i, force_[i], bodies.motion[i]);
    kinetic_[r] += kinetic_gain(bodies, i, impacts.coming()[i], RigidBody());
  }
  const auto gains = [&](int root) { return gain_[at(root)] > 1e-12 * kinetic_[at(root)]; };
  for (std::size_t i = 0; i < bodies.motion.size(); ++i)
    if (takes_part(i) && gains(islands_.root(static_cast<int>(i)))) bodies.motion[i] = first_[i];
  const auto root = [&](int k) { return islands_.root(bodies, contacts.points[at(k)]); };
  for (const Member& m : members_)
    if (gains(m.root)) contacts.impulses[at(m.contact)] = first_impulses_[at(m.contact)];
  taken_.erase(std::remove_if(taken_.begin(), taken_.end(),
                              [&](const Impact& i) { return gains(root(i.contact)); }),
               taken_.end());
}

LaterImpacts::Counts LaterImpacts::take(const NearContacts& near, Impacts& impacts, double dt,
                                        BodySet& bodies, StepContacts& contacts) {
  Counts counts;
  if (!find_islands(near, impacts, bodies, dt, contacts)) return counts;
  first_ = bodies.motion;
  first_impulses_ = contacts.impulses;
  start(near, impacts, dt, bodies, contacts);
  if (run_passes(near, impacts, dt, bodies, contacts, counts)) {
    keep_energy(impacts, bodies, contacts);
    for (const Impact& i : taken_) impacts.add(i);
  } else {
    bodies.motion = first_;
    contacts.impulses = first_impulses_;
    counts.bounces = 0;
  }
  return counts;
}

}  // namespace tether::contact::detail
