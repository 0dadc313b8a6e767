// Tether: motors of joints. SPDX-License-Identifier: BSD-3-Clause
//
// The force along the coordinate that makes its speed the wanted one, or the largest one towards
// it. With gains it follows target + rate t by the law in joint_spring.cpp.

#include "bounds.hpp"
#include "joints/laws/joint_law_effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

bool has_motor(const Joint& joint) { return joint.motor.has_value(); }
bool is_ideal(const Joint& joint) { return joint.motor && !joint.motor->has_gains(); }

class JointMotorEffect : public JointLawEffect {
 public:
  JointMotorEffect() : JointLawEffect("motors", has_motor) {}
  bool has_joint_laws(const Scene& scene) const override { return any_of(scene.joints, is_ideal); }
  void read_joint(files::Fields& in, files::Reader& r, bool angle, Joint& joint) const override {
    const files::Value* table = in.table("motor");
    if (table == nullptr) return;
    files::Fields motor = r.fields(table, in.path() + ": motor");
    JointMotor& m = joint.motor.emplace();
    m.rate = angle ? motor.angle("rate_", 0, "/s") : motor.number("rate", 0, files::kAny, "m/s");
    const char* const bound = angle ? "torque" : "force";
    const char* const unit = angle ? "N m" : "N";
    read_gains(motor, angle, m.stiffness, m.damping);
    if (!m.has_gains() && !motor.has(bound))
      motor.missing(bound, fmt::format("the largest one, {}; not needed with gains", unit));
    m.bound = motor.number(bound, m.has_gains() ? kInfinity : 0, files::kNotNegative, unit);
    for (const char* key : {"target", "target_deg", "target_rad"})
      if (!(m.stiffness > 0) && motor.has(key)) motor.wrong(key, "is of a stiffness above 0");
    m.target = angle ? motor.angle("target_", 0) : motor.number("target", 0, files::kAny, "m");
    motor.finish();
  }
  void write_joint(const Joint& joint, bool angle, files::Writer& out) const override {
    if (!joint.motor) return;
    using files::toml;
    const JointMotor& m = *joint.motor;
    const char* const unit = angle ? "_rad" : "";
    std::string text = fmt::format("{{ rate{} = {}", unit, toml(m.rate));
    if (std::isfinite(m.bound))
      text += fmt::format(", {} = {}", angle ? "torque" : "force", toml(m.bound));
    if (m.has_gains())
      text += fmt::format(", stiffness = {}, damping = {}", toml(m.stiffness), toml(m.damping));
    if (m.stiffness > 0) text += fmt::format(", target{} = {}", unit, toml(m.target));
    out.raw("motor", text + " }");
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    for (const Joint& joint : scene.joints)
      if (joint.motor)
        rate.take(std::abs(joint.motor->rate) / (joints::is_angle(joint) ? 1 : length));
  }
  void convert(Scene& scene, const Units& units) const override {
    for (Joint& joint : scene.joints) {
      if (!joint.motor) continue;
      const bool angle = joints::is_angle(joint);
      joint.motor->rate *= units.time / (angle ? 1 : units.length);
      joint.motor->bound /= angle ? units.energy() : units.force();
      const double stiffness = angle ? units.energy() : units.stiffness();
      joint.motor->stiffness /= stiffness;
      joint.motor->damping /= stiffness * units.time;
      if (!angle) joint.motor->target /= units.length;
    }
  }
  void add_laws(const Joint& joint, int number, double, JointLawList& out) const override {
    if (is_ideal(joint)) out.bounded(number, joint.motor->rate, joint.motor->bound);
  }
};

}  // namespace

TETHER_EFFECT(joint_motor, JointMotorEffect)

}  // namespace tether::scene::effects
