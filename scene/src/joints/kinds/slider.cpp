// Tether: the slider joint. SPDX-License-Identifier: BSD-3-Clause
//
// The attitude and a line along the axis in common; 5 rows, and 1 for the prescribed displacement.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct Slider : AxisJoint {
  JointKind kind() const override { return JointKind::slider; }
  MotionOf motion() const override { return MotionOf::length; }
  bool is_free() const override { return true; }
  void fields(const files::Form& form, Joint& joint) const override {
    form.vector("at", joint.at, kMetres);
    axis(form, joint);
  }
  void add_rows(RowBuilder& rows) const override {
    rows.same_attitude();
    rows.plane(rows.x(), nullptr);
    rows.plane(rows.y(), nullptr);
    if (rows.now()) rows.plane(rows.z(), rows.now());
  }
};

TETHER_JOINT(slider, Slider)

}  // namespace tether::scene::joints
