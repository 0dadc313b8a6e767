// Tether: gaps that inelastic impacts close. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/closing.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

namespace {
using linalg::at;
}  // namespace

bool Closing::find(const Impacts& impacts, const BodySet& bodies, double dt,
                   const StepContacts& contacts, std::vector<RigidBody>& move) {
  closes_.clear();
  bounces_.clear();
  for (const Impact& i : impacts.list()) {
    if (i.restitution > 0)
      bounces_.push_back(i.contact);
    else if (contacts.gaps[at(i.contact)] > 0)
      closes_.push_back(i);
  }
  if (closes_.empty()) return false;
  islands_.join(bodies, contacts);
  marked_.assign(bodies.motion.size(), 0);
  const auto mark = [&](int contact) -> char& {
    return marked_[at(islands_.root(bodies, contacts.points[at(contact)]))];
  };
  for (const Impact& i : closes_) mark(i.contact) = 1;
  for (const int c : bounces_) mark(c) = 0;
  // Contacts of the others are left out. Impulses start as the first solve has found them, but
  // where a gap is left, which takes its part of the approach.
  part_.assign(contacts.points.size(), 1);
  for (const Impact& i : closes_)
    part_[at(i.contact)] = std::max(0.0, 1 - contacts.gaps[at(i.contact)] / (dt * i.comes));
  points_.clear();
  start_.ids.clear();
  start_.impulses.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (!mark(static_cast<int>(k))) continue;
    points_.push_back(contacts.points[k]);
    points_.back().bias = depenetration_.bias(contacts.gaps[k], dt);
    start_.ids.push_back(points_.back().id);
    start_.impulses.push_back(part_[k] * contacts.impulses[k]);
  }
  solver_.set_warm_start(start_);
  solver_.solve(impacts.free(), points_, solution_);
  move.resize(bodies.motion.size());
  for (std::size_t i = 0; i < move.size(); ++i) {
    move[i].velocity.setZero();
    move[i].angular_velocity.setZero();
    if (bodies.mass[i] == 0 || !marked_[at(islands_.root(static_cast<int>(i)))]) continue;
    move[i].velocity = solution_.velocities[i] - bodies.motion[i].velocity;
    move[i].angular_velocity = solution_.angular_velocities[i] - bodies.motion[i].angular_velocity;
  }
  return true;
}

}  // namespace tether::contact::detail
