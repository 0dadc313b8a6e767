// Tether: motors of joints. SPDX-License-Identifier: BSD-3-Clause
//
// The force along the coordinate that makes its speed the wanted one, or the largest one towards
// it.
#include <cmath>

#include "joints/laws/joint_law_effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

bool has_motor(const Joint& joint) { return joint.motor.has_value(); }

class JointMotorEffect : public JointLawEffect {
 public:
  JointMotorEffect() : JointLawEffect("motors", has_motor) {}
  void read_joint(files::Fields& in, files::Reader& r, bool angle, Joint& joint) const override {
    const files::Value* table = in.table("motor");
    if (table == nullptr) return;
    files::Fields motor = r.fields(table, in.path() + ": motor");
    JointMotor& m = joint.motor.emplace();
    m.rate = angle ? motor.angle("rate_", 0, "/s") : motor.number("rate", 0, files::kAny, "m/s");
    const char* const bound = angle ? "torque" : "force";
    const char* const unit = angle ? "N m" : "N";
    if (!motor.has(bound)) motor.missing(bound, fmt::format("the largest one, {}", unit));
    m.bound = motor.number(bound, 0, files::kNotNegative, unit);
    motor.finish();
  }
  void write_joint(const Joint& joint, bool angle, files::Writer& out) const override {
    if (!joint.motor) return;
    out.raw("motor", fmt::format("{{ rate{} = {}, {} = {} }}", angle ? "_rad" : "",
                                 files::toml(joint.motor->rate), angle ? "torque" : "force",
                                 files::toml(joint.motor->bound)));
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
    }
  }
  void add_laws(const Joint& joint, int number, double, JointLawList& out) const override {
    if (joint.motor) out.bounded(number, joint.motor->rate, joint.motor->bound);
  }
};

}  // namespace

const Effect& joint_motor_effect() {
  static const JointMotorEffect effect;
  return effect;
}

}  // namespace tether::scene::effects
