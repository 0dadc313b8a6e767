// Tether: the fixed joint. SPDX-License-Identifier: BSD-3-Clause
//
// A point and the attitude in common; 6 rows.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct Fixed : JointType {
  JointKind kind() const override { return JointKind::fixed; }
  void add_rows(RowBuilder& rows) const override {
    rows.coincide();
    rows.same_attitude();
  }
};

TETHER_JOINT(fixed, Fixed)

}  // namespace tether::scene::joints
