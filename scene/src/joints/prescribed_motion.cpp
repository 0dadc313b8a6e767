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

Motion read_motion(files::Fields& in, bool angle) {
  Motion m;
  if (angle) {
    m.rate = in.angle("rate_", m.rate, "/s");
    m.amplitude = in.angle("amplitude_", m.amplitude);
  } else {
    m.rate = in.number("rate", m.rate, files::kAny, "m/s");
    m.amplitude = in.number("amplitude", m.amplitude, files::kAny, "m");
  }
  m.frequency = in.number("frequency", m.frequency, files::kNotNegative, "Hz");
  m.phase = in.angle("phase_", m.phase);
  in.finish();
  return m;
}

void write_motion(const Motion& m, bool angle, files::Writer& out) {
  using files::toml;
  const char* const unit = angle ? "_rad" : "";
  out.raw("motion",
          fmt::format("{{ rate{} = {}, amplitude{} = {}, frequency = {}, phase_rad = {} }}", unit,
                      toml(m.rate), unit, toml(m.amplitude), toml(m.frequency), toml(m.phase)));
}

}  // namespace joints

namespace effects {

using namespace mechanics;
using joints::is_angle;

namespace {

bool is_driven(const Joint& joint) { return joint.motion.has_value(); }

/// Its fields are those of the joint that it drives; its force is a part of the multipliers.
class PrescribedMotion : public Effect {
 public:
  void plan(const Scene& scene, EngineKind, std::vector<PlannedEffect>& lines) const override {
    const auto count = count_if(scene.joints, is_driven);
    if (count > 0) lines.push_back({"prescribed motion", counted(count, "joint")});
  }
  void check(const Scene& scene, files::Report& report) const override {
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
  void convert(Scene& scene, const Units& units) const override {
    for (Joint& joint : scene.joints) {
      if (!joint.motion) continue;
      const double way = is_angle(joint) ? 1 : units.length;
      joint.motion->rate /= way / units.time;
      joint.motion->amplitude /= way;
      joint.motion->frequency *= units.time;
    }
  }
  bool does_work(const Scene& scene) const override { return any_of(scene.joints, is_driven); }
};

}  // namespace

TETHER_EFFECT(prescribed_motion, PrescribedMotion)

}  // namespace effects

}  // namespace tether::scene
