// Tether: contacts that close within a step. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/impacts.hpp"

#include <cmath>

#include "stepping/sub_step.hpp"

namespace tether::contact::detail {

void Impacts::choose(const NearContacts& near, const BodySet& bodies, double dt,
                     StepContacts& contacts) {
  list_.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    PointContact& c = contacts.points[k];
    const double came = -normal_velocity(coming_, c);
    if (!(came > 0)) continue;
    const double epsilon = given_back(near, c, came);
    if (!(came > least_speed(near, c) || epsilon > 0)) continue;
    const double comes = -normal_velocity(bodies.motion, c);
    if (!(comes > 0) || !(comes * dt > contacts.gaps[k])) continue;
    c.bias = 0;
    list_.push_back({static_cast<int>(k), came, comes, epsilon});
  }
}

void Impacts::keep_only_impacts(StepContacts& contacts) {
  std::size_t kept = 0;  // contacts of the list ascend
  keep_contacts(contacts, [&](std::size_t k) {
    const bool is_impact =
        kept < list_.size() && static_cast<std::size_t>(list_[kept].contact) == k;
    if (is_impact) list_[kept].contact = static_cast<int>(kept), ++kept;
    return is_impact;
  });
}

double Impacts::least_speed(const NearContacts& near, const PointContact& c) const {
  return threshold_ * std::sqrt(near.size(c));
}

double Impacts::given_back(const NearContacts& near, const PointContact& c, double speed) const {
  return speed > restitution_threshold_ * std::sqrt(near.size(c)) ? near.meeting(c).restitution : 0;
}

}  // namespace tether::contact::detail
