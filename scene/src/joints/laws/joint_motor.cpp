// Tether: motors of joints. SPDX-License-Identifier: BSD-3-Clause
//
// The force along the coordinate that makes its speed the wanted one, or the largest one towards
// it. With gains it follows target + rate t by the law in joint_spring.cpp.
#include "bounds.hpp"
#include "joints/laws/joint_law_effect.hpp"

namespace tether::scene::effects {

namespace {

bool has_motor(const Joint& joint) { return joint.motor.has_value(); }
bool is_ideal(const Joint& joint) { return joint.motor && !joint.motor->has_gains(); }

struct JointMotorEffect : JointLawEffect {
  JointMotorEffect() : JointLawEffect("motors", has_motor) {}
  bool has_joint_laws(const Scene& scene) const override { return any_of(scene.joints, is_ideal); }
  void joint_fields(const Form& form, bool angle, Joint& joint) const override {
    form.table("motor", joint.motor, [&](const Form& motor, JointMotor& m) {
      motor.along(angle, "rate", m.rate, kSpeed);
      stiffness(motor, angle, m.stiffness);
      damping(motor, angle, m.damping);
      const char* const bound = angle ? "torque" : "force";
      const Unit unit = angle ? kMoment : kForce;
      if (motor.in() && m.has_gains() && !motor.in()->has(bound)) m.bound = kInfinity;
      if (!m.has_gains())
        motor.require(bound, angle ? "the largest one, N m; not needed with gains"
                                   : "the largest one, N; not needed with gains");
      if (motor.in() ? motor.in()->has(bound) : std::isfinite(m.bound))
        motor.number(bound, m.bound, kNotNegative, unit);
      if (Fields* in = motor.in(); in && !(m.stiffness > 0))
        for (const char* key : {"target", "target_deg", "target_rad"})
          if (in->has(key)) in->wrong(key, "is of a stiffness above 0");
      if (m.stiffness > 0) motor.along(angle, "target", m.target, kMetres);
    });
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    for (const Joint& joint : scene.joints)
      if (joint.motor)
        rate.take(std::abs(joint.motor->rate) / (joints::is_angle(joint) ? 1 : length));
  }
  void add_laws(const Joint& joint, int number, double, JointLawList& out) const override {
    if (is_ideal(joint)) out.bounded(number, joint.motor->rate, joint.motor->bound);
  }
};

}  // namespace

TETHER_EFFECT(joint_motor, JointMotorEffect)

}  // namespace tether::scene::effects
