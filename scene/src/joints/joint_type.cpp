// Tether: all kinds of joints. SPDX-License-Identifier: BSD-3-Clause
#include "joint_type.hpp"

namespace tether::scene::joints {

#define JOINT(name) const JointType& name##_joint();
#include "joint_list.inc"
#undef JOINT

const JointType& type(JointKind kind) {
  static const JointType* const all[] = {
#define JOINT(name) &name##_joint(),
#include "joint_list.inc"
#undef JOINT
  };
  for (const JointType* each : all)
    if (each->kind() == kind) return *each;
  throw std::invalid_argument("unknown kind of joint");
}

std::string name_of(const Joint& joint, std::size_t index) {
  return joint.name.empty() ? std::string(word(joint.kind)) + " " + std::to_string(index)
                            : joint.name;
}

bool is_angle(const Joint& joint) {
  return type(joint.kind).motion() == JointType::MotionOf::angle;
}

int row_count(const Joint& joint) {
  JointRows rows;
  const Frame<double> origin = frame_at(Vector3d::Zero(), Matrix3d::Identity());
  const Now still;
  RowBuilder builder(rows, joint, Row{}, origin, origin, joint.motion ? &still : nullptr);
  type(joint.kind).add_rows(builder);
  return rows.count();
}

}  // namespace tether::scene::joints
