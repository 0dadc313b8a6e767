// Tether: the distance joint. SPDX-License-Identifier: BSD-3-Clause
//
// Two points at a distance, which a motion changes; 1 row.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct DistanceJoint : JointType {
  JointKind kind() const override { return JointKind::distance; }
  MotionOf motion() const override { return MotionOf::length; }
  void fields(const files::Form& form, Joint& joint) const override {
    form.points(joint.at, joint.at_second);
    form.number("length", joint.length, files::kPositive, kMetres);
    const bool apart = (joint.at - joint.at_second).norm() > 0;
    if (files::Fields* in = form.in(); in && in->has("at") && !apart)
      in->wrong("at", "the two points must be apart");
  }
  void check(const Joint& joint, const std::string& name) const override {
    if (!(length(joint) > 0))
      throw std::invalid_argument("joint \"" + name +
                                  "\": a distance must be > 0; two points in one place are a "
                                  "ball joint");
  }
  void add_rows(RowBuilder& rows) const override { rows.distance(length(rows.joint())); }
  const Vector3d& point_on_second(const Joint& joint) const override { return joint.at_second; }
  void take_lengths(const Joint& joint, Largest& longest) const override {
    if (joint.length) longest.take(*joint.length);
    longest.take((joint.at - joint.at_second).norm());
  }
  // A force along the line through the point that is outside.
  void limit_axes(const Joint& joint, Momenta& momenta, const std::string& because) const override {
    const bool second = momenta.is_outside(joint.second);
    momenta.force_through(second ? joint.at_second : joint.at, kOrigin, because);
  }

 private:
  static double length(const Joint& joint) {
    return joint.length ? *joint.length : (joint.at_second - joint.at).norm();
  }
};

TETHER_JOINT(distance, DistanceJoint)

}  // namespace tether::scene::joints
