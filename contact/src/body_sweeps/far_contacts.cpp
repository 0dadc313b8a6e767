// Tether: contacts that are too far open to be swept. SPDX-License-Identifier: BSD-3-Clause
#include "body_sweeps/far_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using linalg::at;

namespace {

Vector3d velocity(const Vector3d& v, const Vector3d& w, const Vector3d& r) {
  return v + w.cross(r);
}

}  // namespace

// open_ and far_ of the contacts of large islands.
void FarContacts::look_at(const GivenProblem& given) {
  const std::vector<PointContact>& contacts = given.contacts();
  const std::vector<RigidBody>& bodies = given.bodies();
  open_.resize(contacts.size());
  far_.resize(contacts.size());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    if (islands_[at(island_[i])].contacts < kLarge) continue;
    const RigidBody& a = bodies[at(c.first)];
    const Vector3d u = velocity(a.velocity, a.angular_velocity, c.r1);
    Vector3d v = Vector3d::Zero();
    if (c.second >= 0) {
      const RigidBody& b = bodies[at(c.second)];
      v = velocity(b.velocity, b.angular_velocity, c.r2);
    }
    open_[i] = c.normal.dot(u - v) + c.bias;
    far_[i] = kPart * (u.norm() + v.norm());
  }
}

// An impulse that stops one contact may close another one as fast.
void FarContacts::find_pace() {
  pace_.assign(islands_.size(), 0);
  count_.assign(islands_.size(), 0);
  for (std::size_t i = 0; i < island_.size(); ++i) {
    const std::size_t k = at(island_[i]);
    if (islands_[k].contacts < kLarge || !(open_[i] < 0)) continue;
    pace_[k] += open_[i] * open_[i];
    ++count_[k];
  }
  for (std::size_t k = 0; k < pace_.size(); ++k)
    if (count_[k] > 0) pace_[k] = std::sqrt(pace_[k] / count_[k]);
}

// Those that are far, unless they are few: not worth another order of sweeping.
void FarContacts::mark(const GivenProblem& given, const Starts& starts) {
  const std::size_t n = given.contacts().size();
  out_.assign(n, 0);
  count_.assign(islands_.size(), 0);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = at(island_[i]);
    if (islands_[k].contacts < kLarge || !(given.contacts()[i].bias > 0)) continue;
    far_[i] += pace_[k];
    const bool pressed = !starts.empty() && starts[i] && !starts[i]->isZero(0);
    out_[i] = open_[i] > far_[i] && !pressed;
    count_[k] += out_[i];
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = at(island_[i]);
    if (!parted(k)) out_[i] = 0;
  }
}

bool FarContacts::leave_out(const GivenProblem& given, const Starts& starts) {
  const std::size_t n = given.contacts().size();
  if (n < at(kLarge)) return false;
  finder_.find(static_cast<int>(given.bodies().size()), {&given.first(), &given.second()}, islands_,
               sorted_, island_);
  if (std::none_of(islands_.begin(), islands_.end(),
                   [](const Island& island) { return island.contacts >= kLarge; }))
    return false;
  look_at(given);
  find_pace();
  mark(given, starts);
  parted_.clear();
  for (std::size_t k = 0; k < islands_.size(); ++k)
    if (parted(k)) parted_.push_back(static_cast<int>(k));
  rest_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = at(island_[i]);
    if (!parted(k)) rest_.push_back(static_cast<int>(i));
  }
  return !parted_.empty();
}

void FarContacts::begin(int group) {
  group_ = group;
  round_ = 0;
  if (group == 0)
    next_ = rest_;
  else
    list_next();
}

// Contacts of the island that are not left out.
void FarContacts::list_next() {
  next_.clear();
  for (const int* i = first(); i != last(); ++i)
    if (!out_[at(*i)]) next_.push_back(*i);
}

bool FarContacts::take_in(const std::vector<PointContact>& contacts, const BodySolution& solution) {
  if (group_ == 0) return false;
  ++round_;
  bool any = false;
  for (const int* i = first(); i != last(); ++i) {
    if (!out_[at(*i)]) continue;
    const PointContact& c = contacts[at(*i)];
    const auto moves = [&](int body, const Vector3d& r) {
      return velocity(solution.velocities[at(body)], solution.angular_velocities[at(body)], r);
    };
    Vector3d u = moves(c.first, c.r1);
    if (c.second >= 0) u -= moves(c.second, c.r2);
    open_[at(*i)] = c.normal.dot(u) + c.bias;
    any = any || open_[at(*i)] < 0;
  }
  if (!any) return false;
  for (const int* i = first(); i != last(); ++i)
    if (open_[at(*i)] < 0.5 * far_[at(*i)] || round_ >= kRounds) out_[at(*i)] = 0;
  list_next();
  return true;
}

int FarContacts::count() const { return static_cast<int>(std::count(out_.begin(), out_.end(), 1)); }

}  // namespace tether::contact::detail
