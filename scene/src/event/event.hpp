// Tether: the record of an event, in the units of the model. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <tether/scene/engine.hpp>

namespace tether::scene::event {

using EventKind = ContactEvent::Kind;

/// Event of one contact. Several contacts may have events of one time.
struct EventRecord {
  double time = 0;
  EventKind kind = EventKind::impact;
  int contact = -1;
  double before = 0, after = 0;                       ///< normal velocities
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();  ///< on the first body, world axes
  double lost = 0;  ///< energy of all contacts of this instant, in its first record
};

}  // namespace tether::scene::event
