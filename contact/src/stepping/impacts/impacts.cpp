// Tether: contacts that close within a step. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/impacts.hpp"

#include <cmath>

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
  for (std::size_t k = 0; k < list_.size(); ++k) {
    const auto from = static_cast<std::size_t>(list_[k].contact);  // ascending
    contacts.points[k] = contacts.points[from];
    contacts.gaps[k] = contacts.gaps[from];
    list_[k].contact = static_cast<int>(k);
  }
  contacts.points.resize(list_.size());
  contacts.gaps.resize(list_.size());
}

double Impacts::least_speed(const NearContacts& near, const PointContact& c) const {
  return threshold_ * std::sqrt(near.size(c));
}

double Impacts::given_back(const NearContacts& near, const PointContact& c, double speed) const {
  return speed > restitution_threshold_ * std::sqrt(near.size(c)) ? near.meeting(c).restitution : 0;
}

}  // namespace tether::contact::detail
