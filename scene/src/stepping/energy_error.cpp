// Tether: what steps leave of the energy. SPDX-License-Identifier: BSD-3-Clause
#include "energy_error.hpp"

namespace tether::scene::stepping {

namespace {

// A normal impulse that changes by more from step to step is one of an impact, or of a force that
// the steps do not resolve.
constexpr double kSteady = 2;

}  // namespace

void EnergyError::begin_at(const contact::BodySet& bodies) {
  last_.clear();
  energy_ = energy(bodies);
  power_ = power(bodies);
}

// Kinetic, and potential of bodies that joints hold. Their velocity at the end of a step is that of
// its middle, and so is the place.
double EnergyError::energy(const contact::BodySet& bodies) const {
  double sum = contact::kinetic_energy(bodies);
  for (std::size_t i = 0; i < joined_.size(); ++i)
    if (joined_[i] != 0)
      sum -=
          bodies.mass[i] * gravity_.dot(bodies.position[i] - 0.5 * dt_ * bodies.motion[i].velocity);
  return sum;
}

// The power of the weight of all others, W.
double EnergyError::power(const contact::BodySet& bodies) const {
  double sum = 0;
  for (std::size_t i = 0; i < joined_.size(); ++i)
    if (joined_[i] == 0) sum += bodies.mass[i] * gravity_.dot(bodies.motion[i].velocity);
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
  for (std::size_t k = 0; k < contacts.impulses.size(); ++k) {
    const contact::PointContact& c = contacts.points[k];
    const double normal = c.normal.dot(contacts.impulses[k]);
    if (!(normal > 0)) continue;
    const double friction = (contacts.impulses[k] - normal * c.normal).norm(), last = before(c.id);
    // A contact with more of its largest friction may slip in a part of the step.
    steady = steady && normal <= kSteady * last && last <= kSteady * normal &&
             (friction == 0 || friction < 0.99 * c.mu * normal);
    now_.emplace_back(c.id, normal);
  }
  steady = steady && now_.size() == last_.size();
  std::swap(last_, now_);
  return steady;
}

// Contacts hold by the velocity at the end of a step, which moves a body, too: the work of its
// weight is the mean of two steps, as it is along the parabola of a free body. Corrections of
// positions are no motion.
void EnergyError::add(const contact::BodySet& bodies, const contact::StepContacts& contacts) {
  const bool steady = note(contacts);
  const double last = std::exchange(energy_, energy(bodies));
  const double pulled = std::exchange(power_, power(bodies));
  if (steady) sum_ += energy_ - last - 0.5 * dt_ * (pulled + power_);
}

}  // namespace tether::scene::stepping
