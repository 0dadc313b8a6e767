// Tether: the joints of a scene, as the contact library's steps take them.
// SPDX-License-Identifier: BSD-3-Clause
#include "stepping_engine.hpp"

namespace tether::scene::stepping {

using namespace mechanics;

// A multiplier pulls with the gradient of its row. JointRows::each goes kind by kind, and rows are
// numbered joint by joint; the parts of a coupling may have bodies in common.
void SteppedJoints::add_rows(const contact::BodySet& bodies, double t, contact::JointRows& out) {
  bodies_.copy(bodies);
  rows_.set_time(t);
  const Bodies& all = bodies_.bodies();
  gradients_.resize(at(rows_.count()));
  for (Gradient& each : gradients_) each.count = 0;
  rows_.each([&](const auto& row) {
    double by_time[3];
    row.rate_by_time(by_time);
    joints::JointRows::each_unit_pull(row, all,
                                      [&](int i, const Wrench<double>& a, const Wrench<double>& b) {
                                        Gradient& gradient = gradients_[at(row.row + i)];
                                        gradient.joint = row.joint;
                                        gradient.rate = -by_time[i];
                                        if (row.first != all.world()) gradient.add(row.first, a);
                                        if (row.second != all.world()) gradient.add(row.second, b);
                                      });
  });
  for (const Gradient& each : gradients_) {
    out.add(each.joint, each.rate);
    for (std::size_t k = 0; k < each.count; ++k) out.on(each.on[k].first, each.on[k].second);
  }
  for (const effects::CapstanSlip& each : laws_.slips()) {
    out.add(static_cast<int>(rows_.joint_count()));
    each.each_load(all, [&](int body, const auto&) { out.on(body, contact::Vector6d::Zero()); });
  }
}

void SteppedJoints::Gradient::add(int body, const Wrench<double>& wrench) {
  contact::Vector6d G;
  G << wrench.force, wrench.torque;
  for (std::size_t k = 0; k < count; ++k)
    if (on[k].first == body) {
      on[k].second += G;
      return;
    }
  if (count == on.size()) on.emplace_back();
  on[count++] = {body, G};
}

}  // namespace tether::scene::stepping
