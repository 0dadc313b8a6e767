// Tether: what steps leave of the energy. SPDX-License-Identifier: BSD-3-Clause
#include "energy_error.hpp"

#include <tether/linalg/index.hpp>

namespace tether::scene::stepping {

using Eigen::Vector3d;
using linalg::at;

namespace {

// A normal impulse that changes by more from step to step is one of an impact, or of a force that
// the steps do not resolve.
constexpr double kSteady = 2;
// A contact with more of its largest friction may slip in a part of the step.
constexpr double kHolds = 0.99;

}  // namespace

EnergyError::EnergyError(const Vector3d& gravity, double dt, std::vector<char> joined,
                         const contact::BodySet& bodies)
    : gravity_(gravity),
      dt_(dt),
      joined_(std::move(joined)),
      held_(joined_),
      energy_(energy(bodies)) {}

void EnergyError::begin_at(const contact::BodySet& bodies) {
  last_.clear();
  held_ = joined_;
  energy_ = energy(bodies);
}

// A body that is held moves by the velocity at the end of the step, which is therefore that of its
// middle: the energy is that of the place there. Free bodies fall along their parabola.
double EnergyError::energy(const contact::BodySet& bodies) const {
  double sum = contact::kinetic_energy(bodies);
  for (std::size_t i = 0; i < held_.size(); ++i) {
    const double back = held_[i] != 0 ? 0.5 * dt_ : 0;
    sum -= bodies.mass[i] * gravity_.dot(bodies.position[i] - back * bodies.motion[i].velocity);
  }
  return sum;
}

// The normal impulse of the step before; 0: none. Contacts mostly keep their order.
double EnergyError::before(std::uint64_t id) {
  for (std::size_t k = 0; k < last_.size(); ++k, ++next_) {
    if (next_ >= last_.size()) next_ = 0;
    if (last_[next_].first == id) return last_[next_++].second;
  }
  return 0;
}

// Keeps the impulses of the step; whether the same contacts as before hold.
bool EnergyError::note(const contact::StepContacts& contacts) {
  bool steady = true;
  next_ = 0;
  now_.clear();
  held_ = joined_;
  for (std::size_t k = 0; k < contacts.impulses.size(); ++k) {
    const contact::PointContact& c = contacts.points[k];
    const double normal = c.normal.dot(contacts.impulses[k]);
    if (!(normal > 0)) continue;
    const double friction = (contacts.impulses[k] - normal * c.normal).norm(), last = before(c.id);
    steady = steady && normal <= kSteady * last && last <= kSteady * normal &&
             (friction == 0 || friction < kHolds * c.mu * normal);
    now_.emplace_back(c.id, normal);
    for (const int body : {c.first, c.second})
      if (body >= 0) held_[at(body)] = 1;
  }
  steady = steady && now_.size() == last_.size();
  std::swap(last_, now_);
  return steady;
}

void EnergyError::add(const contact::BodySet& bodies, const contact::StepContacts& contacts) {
  const bool steady = note(contacts);
  const double last = std::exchange(energy_, energy(bodies));
  if (steady) sum_ += energy_ - last;
}

}  // namespace tether::scene::stepping
