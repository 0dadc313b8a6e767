// Tether: bodies at rest that steps leave out. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/sleeping.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "joints/stepping/step_joints.hpp"

#include "stepping/sub_step.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr double kAtFirst = 1e-3;  // the same where a body has just come to rest, of its weight

}  // namespace

Sleeping::Sleeping(const BodySet& bodies, std::vector<double> sizes, double speed, double gravity)
    : size_(std::move(sizes)), speed_(speed), gravity_(gravity) {
  const std::size_t n = bodies.motion.size();
  held_.assign(n, 0);
  may_.resize(n);
  for (std::size_t i = 0; i < n; ++i) may_[i] = bodies.mass[i] > 0;
  body_.resize(n);
  asleep_.assign(n, 0);
  place_.resize(n);
}

void Sleeping::set_joints(const StepJoints& joints) {
  for (std::size_t i = 0; i < may_.size(); ++i) {
    held_[i] = joints.holds(static_cast<int>(i));
    may_[i] = may_[i] != 0 && held_[i] == 0;
  }
}

void Sleeping::wake(int island) {
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (asleep_[i] == 0 || body_[i].island != island) continue;
    asleep_[i] = 0;
    body_[i].island = -1;
    body_[i].slow = 0;
    --count_;
  }
  keep_contacts(kept_, [&](std::size_t k) {
    if (sleeps(kept_.points[k])) return true;
    woken_.ids.push_back(kept_.points[k].id);
    woken_.impulses.push_back(kept_.impulses[k]);
    return false;
  });
  neighbours_.erase(
      std::remove_if(neighbours_.begin(), neighbours_.end(),
                     [&](const StepperMemory::Neighbour& n) { return n.island == island; }),
      neighbours_.end());
  list_kept();
}

void Sleeping::list_kept() {
  kept_ids_.clear();
  for (const PointContact& c : kept_.points) kept_ids_.push_back(c.id);
  std::sort(kept_ids_.begin(), kept_ids_.end());
}

bool Sleeping::has_changed(int body, const Vector3d& a, const Vector3d& turn, const RigidBody& came,
                           const BodySet& bodies) const {
  const StepperMemory::Rest& rest = body_[at(body)];
  const Place& place = place_[at(body)];
  if (!came.velocity.isZero(0) || !came.angular_velocity.isZero(0) ||
      bodies.position[at(body)] != place.position ||
      bodies.orientation[at(body)].coeffs() != place.orientation.coeffs())
    return true;
  const double most =
      rest.fresh ? kAtFirst * gravity_ : 1e-9 * (gravity_ + rest.acceleration.norm());
  return !((a - rest.acceleration).norm() +
               size_[at(body)] * (turn - rest.angular_acceleration).norm() <=
           most);
}

bool Sleeping::has_moved(const StepperMemory::Neighbour& n, const BodySet& bodies) const {
  const std::size_t i = at(n.body);
  const RigidBody& now = bodies.motion[i];
  const bool fixed = bodies.mass[i] == 0;
  const double size = fixed ? 0 : size_[i];
  const double way = (bodies.position[i] - n.position).norm() +
                     size * bodies.orientation[i].angularDistance(n.orientation);
  const double speed = (now.velocity - n.velocity).norm() +
                       size * (now.angular_velocity - n.angular_velocity).norm();
  if (fixed)
    return way > 0 || speed > 0 || now.angular_velocity != n.angular_velocity ||
           bodies.orientation[i].coeffs() != n.orientation.coeffs();
  return !(way <= 1e-8 * size) || !(speed <= kAtFirst * speed_ * std::sqrt(size));
}

void Sleeping::hold(const std::vector<RigidBody>& coming, double dt, BodySet& bodies) {
  woken_islands_.clear();
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (may_[i] == 0) continue;
    const Vector3d a = (bodies.motion[i].velocity - coming[i].velocity) / dt;
    const Vector3d turn = (bodies.motion[i].angular_velocity - coming[i].angular_velocity) / dt;
    if (asleep_[i] != 0) {
      const bool changed = has_changed(static_cast<int>(i), a, turn, coming[i], bodies);
      if (changed) woken_islands_.push_back(body_[i].island);
      if (!body_[i].fresh) continue;
      body_[i].fresh = false;
    }
    body_[i].acceleration = a;
    body_[i].angular_acceleration = turn;
  }
  for (const StepperMemory::Neighbour& n : neighbours_)
    if (has_moved(n, bodies)) woken_islands_.push_back(n.island);
  wake_all();
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (asleep_[i] == 0) continue;
    bodies.motion[i].velocity.setZero();
    bodies.motion[i].angular_velocity.setZero();
  }
  for (std::size_t k = 0; k < kept_.points.size(); ++k) {
    const PointContact& c = kept_.points[k];
    const Vector3d p = dt * kept_.impulses[k];
    if (held_[at(c.first)] != 0) push(bodies.motion[at(c.first)], c.r1, p);
    if (held_[at(c.second)] != 0) push(bodies.motion[at(c.second)], c.r2, -p);
  }
}

bool Sleeping::wake_all() {
  std::sort(woken_islands_.begin(), woken_islands_.end());
  woken_islands_.erase(std::unique(woken_islands_.begin(), woken_islands_.end()),
                       woken_islands_.end());
  for (const int island : woken_islands_) wake(island);
  return !woken_islands_.empty();
}

bool Sleeping::wake_touched(const NearContacts& near, const BodySet& bodies, const Impacts& impacts,
                            double dt, StepContacts& contacts) {
  woken_islands_.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const PointContact& c = contacts.points[k];
    const bool touches = contacts.gaps[k] + dt * normal_velocity(bodies.motion, c) <= 0;
    if (!touches) continue;
    if (sleeps(c)) {
      if (!std::binary_search(kept_ids_.begin(), kept_ids_.end(), c.id))
        woken_islands_.push_back(island_of(c));
      continue;
    }
    if (-normal_velocity(impacts.coming(), c) > impacts.least_speed(near, c))
      for (const StepperMemory::Neighbour& n : neighbours_)
        if (held_[at(n.body)] != 0 && (n.body == c.first || n.body == c.second))
          woken_islands_.push_back(n.island);
  }
  if (wake_all()) return true;
  leave_out(contacts);
  return false;
}

void Sleeping::leave_out(StepContacts& contacts) const {
  keep_contacts(contacts, [&](std::size_t k) { return !sleeps(contacts.points[k]); });
}

void Sleeping::end(double dt, BodySet& bodies, StepContacts& contacts) const {
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (asleep_[i] == 0) continue;
    bodies.position[i] = place_[i].position;
    bodies.orientation[i] = place_[i].orientation;
    bodies.motion[i] = place_[i].motion;
  }
  contacts.impulses.resize(contacts.points.size(), Vector3d::Zero());
  for (std::size_t k = 0; k < kept_.points.size(); ++k) {
    contacts.points.push_back(kept_.points[k]);
    contacts.gaps.push_back(kept_.gaps[k]);
    contacts.impulses.emplace_back(dt * kept_.impulses[k]);
  }
}

bool Sleeping::has_rested(int body) const {
  return body_[at(body)].slow >= 5 * std::sqrt(size_[at(body)] / gravity_);
}

void Sleeping::fall_asleep(double dt, BodySet& bodies, const StepContacts& contacts) {
  bool any = false;
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (asleep_[i] != 0 || (may_[i] == 0 && held_[i] == 0)) continue;
    const RigidBody& b = bodies.motion[i];
    const bool slow =
        b.velocity.norm() + size_[i] * b.angular_velocity.norm() < speed_ * std::sqrt(size_[i]);
    body_[i].slow = slow ? body_[i].slow + dt : 0;
    any = any || (may_[i] != 0 && has_rested(static_cast<int>(i)));
  }
  if (any) find_rested(dt, bodies, contacts);
}

// Islands by contacts that press, not across bodies that do not sleep.
void Sleeping::find_rested(double dt, BodySet& bodies, const StepContacts& contacts) {
  const auto may = [&](int body) { return may_[at(body)] != 0; };
  pressing_.points.clear();
  loads_.clear();
  for (std::size_t k = 0; k < std::min(contacts.impulses.size(), contacts.points.size()); ++k) {
    const PointContact& c = contacts.points[k];
    if (contacts.impulses[k].isZero(0) || !(may(c.first) || may(c.second))) continue;
    loads_.push_back(k);
    if (may(c.first) && may(c.second)) pressing_.points.push_back(c);
  }
  islands_.join(bodies, pressing_);
  const auto root = [&](std::size_t k) {
    const PointContact& c = contacts.points[k];
    return islands_.root(may(c.first) ? c.first : c.second);
  };
  rested_.assign(body_.size(), 0);
  for (const std::size_t k : loads_) rested_[at(root(k))] = 1;
  for (int i = 0; i < bodies.size(); ++i)
    if (may(i) && (asleep_[at(i)] != 0 || !has_rested(i))) rested_[at(islands_.root(i))] = 0;
  for (const std::size_t k : loads_)
    for (const int body : {contacts.points[k].first, contacts.points[k].second})
      if (held_[at(body)] != 0 && !has_rested(body)) rested_[at(root(k))] = 0;
  for (int body = 0; body < bodies.size(); ++body) {
    const std::size_t i = at(body);
    const int island = islands_.root(body);
    if (!may(body) || rested_[at(island)] == 0) continue;
    bodies.motion[i].velocity.setZero();
    bodies.motion[i].angular_velocity.setZero();
    place_[i] = {bodies.position[i], bodies.orientation[i], bodies.motion[i]};
    asleep_[i] = 1;
    body_[i].island = island;
    body_[i].fresh = true;
    ++count_;
  }
  for (const std::size_t k : loads_) {
    if (rested_[at(root(k))] == 0) continue;
    const PointContact& c = contacts.points[k];
    kept_.points.push_back(c);
    kept_.gaps.push_back(contacts.gaps[k]);
    kept_.impulses.emplace_back(contacts.impulses[k] / dt);
    for (const int body : {c.first, c.second})
      if (!may(body)) add_neighbour(body, root(k), bodies);
  }
  list_kept();
}

void Sleeping::add_neighbour(int body, int island, const BodySet& bodies) {
  for (const StepperMemory::Neighbour& n : neighbours_)
    if (n.body == body && n.island == island) return;
  const RigidBody& b = bodies.motion[at(body)];
  neighbours_.push_back({body, island, bodies.position[at(body)], bodies.orientation[at(body)],
                         b.velocity, b.angular_velocity});
}

WarmStart Sleeping::take_woken(double dt) {
  WarmStart out = std::exchange(woken_, {});
  for (Vector3d& x : out.impulses) x *= dt;
  return out;
}

void Sleeping::wake_everybody() {
  body_.assign(body_.size(), {});
  asleep_.assign(asleep_.size(), 0);
  count_ = 0;
  kept_ = {};
  neighbours_.clear();
  woken_ = {};
  list_kept();
}

StepperMemory::Sleep Sleeping::memory() const { return {body_, kept_, neighbours_}; }

void Sleeping::set_memory(const StepperMemory::Sleep& m, const BodySet& bodies) {
  const int n = bodies.size();
  const auto known = [&](int body) { return body >= 0 && body < n; };
  bool fits = m.bodies.size() == body_.size();
  for (const StepperMemory::Rest& r : m.bodies) fits = fits && r.island >= -1 && r.island < n;
  for (const StepperMemory::Neighbour& each : m.neighbours)
    fits = fits && known(each.body) && known(each.island);
  for (const PointContact& c : m.contacts.points) fits = fits && known(c.first) && known(c.second);
  if (!fits) throw std::invalid_argument("stepping: a memory of the sleep of other bodies");
  body_ = m.bodies;
  kept_ = m.contacts;
  neighbours_ = m.neighbours;
  woken_ = {};
  list_kept();
  count_ = 0;
  for (std::size_t i = 0; i < body_.size(); ++i) {
    asleep_[i] = may_[i] != 0 && body_[i].island >= 0;
    count_ += asleep_[i];
    place_[i] = {bodies.position[i], bodies.orientation[i], bodies.motion[i]};
  }
}

}  // namespace tether::contact::detail
