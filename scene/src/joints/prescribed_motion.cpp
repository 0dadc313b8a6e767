// Tether: prescribed motions of joints. SPDX-License-Identifier: BSD-3-Clause
#include "rows.hpp"

#include <tether/linalg/pi.hpp>

#include "effects/numbers.hpp"
#include "joint_type.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene {

namespace joints {

Now evaluate(const Motion& motion, double t) {
  const double speed = 2 * linalg::kPi * motion.frequency, angle = speed * t + motion.phase;
  Now now;
  now.s = motion.rate * t + motion.amplitude * (std::sin(angle) - std::sin(motion.phase));
  now.s1 = motion.rate + motion.amplitude * speed * std::cos(angle);
  now.s2 = -motion.amplitude * speed * speed * std::sin(angle);
  return now;
}

void motion_fields(const files::Form& form, bool angle, Motion& m) {
  form.along(angle, "rate", m.rate, kSpeed);
  form.along(angle, "amplitude", m.amplitude, kMetres);
  form.number("frequency", m.frequency, files::kNotNegative, kHertz);
  form.angle("phase_", m.phase);
}

}  // namespace joints

namespace effects {

using namespace mechanics;
using joints::is_angle;

namespace {

bool is_driven(const Joint& joint) { return joint.motion.has_value(); }

/// Its fields are those of the joint that it drives; its force is a part of the multipliers.
struct PrescribedMotion : Effect {
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "prescribed motion", count_if(scene.joints, is_driven), "joint");
  }
  void check(const Scene& scene, Report& report) const override {
    for (const Joint& joint : scene.joints)
      if (joint.motion)
        check_frequency(scene, joint.motion->frequency, joint.place, "joint: motion: frequency",
                        report);
  }
  void take_lengths(const Scene& scene, Largest& length) const override {
    for (const Joint& joint : scene.joints)
      if (joint.motion && !is_angle(joint)) length.take(std::abs(joint.motion->amplitude));
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    for (const Joint& joint : scene.joints) {
      if (!joint.motion) continue;
      rate.take(joint.motion->frequency);
      rate.take(std::abs(joint.motion->rate) / (is_angle(joint) ? 1 : length));
    }
  }
  bool does_work(const Scene& scene) const override { return any_of(scene.joints, is_driven); }
};

}  // namespace

TETHER_EFFECT(prescribed_motion, PrescribedMotion)

}  // namespace effects

}  // namespace tether::scene
