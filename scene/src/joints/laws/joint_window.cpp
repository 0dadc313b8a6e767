// Tether: joints that attach, detach and break. SPDX-License-Identifier: BSD-3-Clause
//
// The engine of switching/ moves them; here are their fields.
#include "joints/joint_type.hpp"
#include "joints/window_rules.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

namespace {

constexpr Unit kSeconds{"s", 0, 0, 1};
constexpr const char* kKeys[] = {"from", "to", "break_force", "break_moment"};

bool switches(const Joint& joint) {
  return joint.window && (joint.window->from > 0 || std::isfinite(joint.window->to));
}
bool breaks(const Joint& joint) { return joint.window && joint.window->breaks(); }

struct JointWindowEffect : Effect {
  ActsOn acts_on() const override { return ActsOn::all_joints; }

  void joint_fields(const Form& form, bool, Joint& joint) const override {
    Fields* const in = form.in();
    if (in && !joint.window && any_of(kKeys, [&](const char* key) { return in->has(key); }))
      joint.window.emplace();
    if (!joint.window) return;
    JointWindow& w = *joint.window;
    const auto number = [&](const char* key, double& x, const Unit& unit) {
      if (in ? in->has(key) : std::isfinite(x)) form.number(key, x, kPositive, unit);
    };
    form.number("from", w.from, kNotNegative, kSeconds);
    number("to", w.to, kSeconds);
    number("break_force", w.break_force, kForce);
    number("break_moment", w.break_moment, kMoment);
    if (in && w.from > 0 && in->has("length"))
      in->wrong("length",
                "is of a joint that holds from the start: one that attaches later takes its bodies "
                "as they are then");
    const bool has_moment = joint.kind != JointKind::distance &&
                            (joint.kind != JointKind::ball || joint.spring.has_value());
    if (in && in->has("break_moment") && !has_moment)
      in->wrong("break_moment",
                "is of a joint that has moments: a distance, and a ball without a "
                "spring, has none");
  }

  void check(const Scene& scene, Report& report) const override {
    joints::check_windows(scene, [&](const auto&... problem) { report.add(problem...); });
  }

  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "attach, detach", count_if(scene.joints, switches), "joint");
    add_count(lines, "breaking", count_if(scene.joints, breaks), "joint");
  }
};

}  // namespace

TETHER_EFFECT(joint_window, JointWindowEffect)

}  // namespace tether::scene::effects
