// Tether: the ball joint. SPDX-License-Identifier: BSD-3-Clause
//
// A point in common; 3 rows.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct Ball : JointType {
  JointKind kind() const override { return JointKind::ball; }
  bool turns_freely() const override { return true; }
  void add_rows(RowBuilder& rows) const override { rows.coincide(); }
  // A force through the point.
  void limit_axes(const Joint& joint, Momenta& momenta, const std::string& because) const override {
    momenta.force_through(joint.at, kOrigin, because);
  }
};

TETHER_JOINT(ball, Ball)

}  // namespace tether::scene::joints
