// Tether: the hinge joint. SPDX-License-Identifier: BSD-3-Clause
//
// A point and an axis in common; 5 rows, and 1 for the prescribed angle.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct Hinge : AxisJoint {
  JointKind kind() const override { return JointKind::hinge; }
  MotionOf motion() const override { return MotionOf::angle; }
  bool is_free() const override { return true; }
  void add_rows(RowBuilder& rows) const override {
    rows.coincide();
    rows.right_angle(rows.z(), rows.x());
    rows.right_angle(rows.z(), rows.y());
    if (rows.now()) rows.prescribed_angle();
  }
  // No torque about its axis, if that passes through the origin.
  void limit_axes(const Joint& joint, Momenta& momenta, const std::string& because) const override {
    if (!joint.motion && joint.at.cross(joint.axis).norm() < kOrigin * joint.axis.norm())
      momenta.axes.only(joint.axis.normalized(), because);
    else
      momenta.axes.none(because);
  }
};

TETHER_JOINT(hinge, Hinge)

}  // namespace tether::scene::joints
