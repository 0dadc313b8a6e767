// Tether: contacts that close within a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"

namespace tether::contact::detail {

/// An impact: speed of approach before and with the forces of the step, > 0, m/s, and coefficient
/// of restitution (0: too slow to bounce).
struct Impact {
  int contact;
  double came, comes, restitution;
};

/// Chooses the whole impacts of a step (method, section 7.1). An approach that ends within the step
/// gets bias 0. With gap / dt a part of the impact would be left to the next step; if slip stops or
/// reverses, the two parts do not add up to the whole, however short the step. Approaches slower
/// than the threshold keep gap / dt, so that bodies come to rest at the surface.
class Impacts {
 public:
  /// Thresholds in m/s for a size of 1 m; they grow with the root of the size. With restitution an
  /// approach is an impact above the smaller of both.
  Impacts(double threshold, double restitution_threshold)
      : threshold_(threshold), restitution_threshold_(restitution_threshold) {}

  /// Keeps the velocities at the start of a step, before forces.
  void remember(const BodySet& bodies) { remember(bodies.motion); }
  void remember(const std::vector<RigidBody>& coming) { coming_ = coming; }
  const std::vector<RigidBody>& coming() const { return coming_; }
  /// After the contacts are found.
  void choose(const NearContacts& near, const BodySet& bodies, double dt, StepContacts& contacts);
  const std::vector<Impact>& list() const { return list_; }
  /// Calls visit(k) for those of so many contacts that are no impacts.
  template <class Visit>
  void each_other(std::size_t contacts, const Visit& visit) const {
    std::size_t next = 0;
    for (std::size_t k = 0; k < contacts; ++k)
      if (next < list_.size() && static_cast<std::size_t>(list_[next].contact) == k)
        ++next;
      else
        visit(k);
  }
  /// Removes all other contacts.
  void keep_only_impacts(StepContacts& contacts);
  /// Least speed of approach, m/s, of an impact.
  double least_speed(const NearContacts& near, const PointContact& c) const;
  /// Coefficient of restitution for this speed; 0: too slow to bounce.
  double given_back(const NearContacts& near, const PointContact& c, double speed) const;
  bool is_impact(const NearContacts& near, const PointContact& c, double speed) const {
    return speed > least_speed(near, c) || given_back(near, c, speed) > 0;
  }

 private:
  double threshold_, restitution_threshold_;
  std::vector<RigidBody> coming_;
  std::vector<Impact> list_;
};

}  // namespace tether::contact::detail
