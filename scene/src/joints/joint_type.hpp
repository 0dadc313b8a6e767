// Tether: the interface of one kind of joint. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "coordinate.hpp"
#include "joint_rows.hpp"
#include "mechanics/momenta.hpp"
#include "toml/form.hpp"

namespace tether::scene::joints {

/// The rows that it adds are all that the engines know of a joint.
class JointType {
 public:
  virtual ~JointType() = default;
  virtual JointKind kind() const = 0;

  /// Its fields beside name, kind, bodies and motion. Default: the point `at`.
  virtual void fields(const files::Form& form, Joint& joint) const { point(form, joint); }
  /// Checks what must hold of a joint that was filled in by hand, beside two bodies that can move
  /// against each other. Throws std::invalid_argument; `name` for messages.
  virtual void check(const Joint&, const std::string& /*name*/) const {}

  /// At t = 0, in world axes.
  virtual void add_rows(RowBuilder& rows) const = 0;

  /// The quantity that a motion prescribes.
  using MotionOf = joints::MotionOf;
  virtual MotionOf motion() const { return MotionOf::nothing; }

  /// Whether that quantity is free without a motion: limits, motors and friction act along it.
  virtual bool is_free() const { return false; }
  /// Whether it leaves all turns free, against which a spring may act.
  virtual bool turns_freely() const { return false; }

  virtual const Vector3d& point_on_second(const Joint& joint) const { return joint.at; }
  virtual void take_lengths(const Joint&, Largest&) const {}
  /// Limits the axes of `momenta` by a joint to the world. Default: torques in all directions.
  virtual void limit_axes(const Joint&, Momenta& momenta, const std::string& because) const {
    momenta.axes.none(because);
  }

 protected:
  static constexpr double kOrigin = 1e-12;  // m: a point this near to the origin is there

  static void point(const files::Form& form, Joint& joint) {
    form.require("at", "a point [x, y, z], world, m");
    form.vector("at", joint.at, kMetres);
  }
  static void axis(const files::Form& form, Joint& joint) {
    form.require("axis", "a direction [x, y, z], world");
    form.direction("axis", joint.axis);
  }
  static void check_axis(const Vector3d& axis, const std::string& name) {
    if (!(axis.norm() > 0))
      throw std::invalid_argument("joint \"" + name + "\": its axis has no length");
  }
};

/// A joint of a point and a direction in common.
class AxisJoint : public JointType {
 public:
  void fields(const files::Form& form, Joint& joint) const override {
    point(form, joint);
    axis(form, joint);
  }
  void check(const Joint& joint, const std::string& name) const override {
    check_axis(joint.axis, name);
  }
};

/// Defines <name>_joint(), which the list of joints asks for.
#define TETHER_JOINT(name, Kind)    \
  const JointType& name##_joint() { \
    static const Kind joint;        \
    return joint;                   \
  }

/// Throws std::invalid_argument for a value that is no kind of joint.
const JointType& type(JointKind kind);

/// That of the scene or, without one, its kind and index.
std::string name_of(const Joint& joint, std::size_t index);

/// Its free or prescribed coordinate is an angle.
bool is_angle(const Joint& joint);

/// Rows of a joint on positions and orientations.
int row_count(const Joint& joint);

}  // namespace tether::scene::joints
