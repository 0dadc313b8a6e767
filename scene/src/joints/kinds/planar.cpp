// Tether: the planar joint. SPDX-License-Identifier: BSD-3-Clause
//
// The first body moves in a plane of the second and turns about its normal; 3 rows.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct Planar : AxisJoint {
  JointKind kind() const override { return JointKind::planar; }
  void add_rows(RowBuilder& rows) const override {
    rows.right_angle(rows.x(), rows.z());
    rows.right_angle(rows.y(), rows.z());
    rows.plane(rows.z(), nullptr);
  }
};

TETHER_JOINT(planar, Planar)

}  // namespace tether::scene::joints
