// Tether: contacts that close within a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"

namespace tether::contact::detail {

/// A contact that strikes: approach before and with the forces of the step, > 0, m/s; what of it is
/// given back (0: too slow to bounce).
struct Impact {
  int contact;
  double came, comes, restitution;
};

/// method, section 7. An approach that ends within the step ends at once and as a whole, bias 0:
/// with gap / dt, part of it would be left to the next step, and where slip stops or turns round in
/// the impact the two parts do not add up to the whole, however short the step. Slower approaches
/// than the threshold keep gap / dt, so that what comes to rest does so at the surface.
class Impacts {
 public:
  /// In m/s for a size of 1 m; they go with the root of the size (method, section 7). What may
  /// bounce is an impact above the smaller of both.
  Impacts(double threshold, double restitution_threshold)
      : threshold_(threshold), restitution_threshold_(restitution_threshold) {}

  /// Start of a step: velocities that bodies come with, before forces.
  void remember(const BodySet& bodies) { remember(bodies.motion); }
  void remember(const std::vector<RigidBody>& coming) { coming_ = coming; }
  const std::vector<RigidBody>& coming() const { return coming_; }
  /// After the contacts are found.
  void choose(const NearContacts& near, const BodySet& bodies, double dt, StepContacts& contacts);
  const std::vector<Impact>& list() const { return list_; }
  /// Leaves nothing but these.
  void keep_only_impacts(StepContacts& contacts);
  /// Velocities with the forces of the step, before impulses; where there are impacts.
  const std::vector<RigidBody>& free() const { return free_; }
  /// An impact that the first ones have caused.
  void add(const Impact& later) { list_.push_back(later); }
  /// Approach, m/s, from which on it is an impact.
  double least_speed(const NearContacts& near, const PointContact& c) const;
  /// The part of an approach that comes back; 0: too slow to bounce.
  double given_back(const NearContacts& near, const PointContact& c, double speed) const;
  bool is_impact(const NearContacts& near, const PointContact& c, double speed) const {
    return speed > least_speed(near, c) || given_back(near, c, speed) > 0;
  }

 private:
  double threshold_, restitution_threshold_;
  std::vector<RigidBody> coming_, free_;
  std::vector<Impact> list_;
};

}  // namespace tether::contact::detail
