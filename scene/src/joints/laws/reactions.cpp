// Tether: what joints do to their bodies. SPDX-License-Identifier: BSD-3-Clause
#include "reactions.hpp"

namespace tether::scene::joints {

Reactions::Reactions(const Scene& scene, const Bodies& bodies) {
  for (const Joint& joint : scene.joints) joints_.emplace_back(joint, bodies);
}

std::vector<JointForce> Reactions::find(const JointRows& rows, const Bodies& bodies,
                                        const double* multipliers) const {
  std::vector<JointForce> out(joints_.size());
  rows.each([&](const auto& row) {
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(bodies.frames[at(row.first)], bodies.frames[at(row.second)], multipliers + row.row, a,
             b);
    out[at(row.joint)].force += a.force;
    out[at(row.joint)].moment += a.torque;  // about the centre so far
  });
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Coordinate& joint = joints_[j];
    JointForce& each = out[j];
    each.at = joint.place(bodies);
    each.moment -= (each.at - bodies.frames[at(joint.first())].x).cross(each.force);
    if (joint.what() == MotionOf::nothing) continue;
    each.drive =
        joint.direction(bodies).dot(joint.what() == MotionOf::angle ? each.moment : each.force);
  }
  return out;
}

}  // namespace tether::scene::joints
