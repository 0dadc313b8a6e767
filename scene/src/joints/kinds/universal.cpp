// Tether: the universal joint. SPDX-License-Identifier: BSD-3-Clause
//
// A cross joins the bodies: they have its centre in common, and its arms, one fixed in each body,
// stay at right angles; 4 rows.
#include "joints/joint_type.hpp"

namespace tether::scene::joints {

struct Universal : JointType {
  JointKind kind() const override { return JointKind::universal; }
  void fields(const files::Form& form, Joint& joint) const override {
    point(form, joint);
    if (form.in()) read_arms(*form.in(), joint);
    if (form.out()) form.out()->field("axis", std::vector<Vector3d>{joint.axis, joint.axis_second});
  }
  void check(const Joint& joint, const std::string& name) const override {
    check_axis(joint.axis, name);
    check_axis(joint.axis_second, name);
    if (!is_right(joint.axis, joint.axis_second))
      throw std::invalid_argument("joint \"" + name + "\": its two axes are not at right angles");
  }
  void add_rows(RowBuilder& rows) const override {
    rows.coincide();
    rows.right_angle(rows.joint().axis.normalized(), rows.joint().axis_second.normalized());
  }

 private:
  static void read_arms(files::Fields& in, Joint& joint) {
    constexpr const char* kAllowed =
        "the arms of the cross [[x, y, z], [x, y, z]] on the first and on the second body, world, "
        "at "
        "right angles";
    if (!in.has("axis")) in.missing("axis", kAllowed);
    const std::vector<Vector3d> axes = in.points("axis", 2, 2);
    if (axes.empty()) return;
    if (!(axes[0].norm() > 0 && axes[1].norm() > 0 && is_right(axes[0], axes[1])))
      return in.wrong("axis", std::string("must be ") + kAllowed);
    joint.axis = axes[0];
    joint.axis_second = axes[1];
  }
  // Digits of a file are rounded; the start is moved onto the joint.
  static bool is_right(const Vector3d& u, const Vector3d& v) {
    return std::abs(u.normalized().dot(v.normalized())) < 1e-6;
  }
};

TETHER_JOINT(universal, Universal)

}  // namespace tether::scene::joints
