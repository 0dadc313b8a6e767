// Tether: joints of a scene as an effect. SPDX-License-Identifier: BSD-3-Clause
//
// Their forces are the multipliers of their rows, which the smooth engine solves for.
#include "effects/list.hpp"
#include "joint_type.hpp"
#include "mechanics/effect.hpp"
#include "rows.hpp"

namespace tether::scene::effects {

using namespace mechanics;
using joints::JointType;

namespace {

// False: its kind is not known, and what it would have is passed over.
bool read_kind(Fields& in, Joint& joint) {
  if (!in.has("kind")) {
    std::vector<std::string> words;
    for (const auto& [text, kind] : kJointWords) words.emplace_back(text);
    in.missing("kind", "it is one of " + list(words));
  }
  const std::optional<JointKind> kind = in.word_of<JointKind>("kind");
  if (!kind)
    in.pass_over({"at", "axis", "length", "motion", "limits", "limits_deg", "limits_rad",
                  "limit_restitution", "motor", "friction", "spring", "from", "to", "break_force",
                  "break_moment"});
  joint.kind = kind.value_or(joint.kind);
  return kind.has_value();
}

bool one_joint(const Form& form, Joint& joint) {
  form.name("joint", joint.name);
  const bool known = !form.in() || read_kind(*form.in(), joint);
  if (form.out()) form.word("kind", joint.kind);
  form.bodies(joint.first, joint.second);
  if (!known) return false;
  const JointType& type = joints::type(joint.kind);
  type.fields(form, joint);
  if (type.motion() != JointType::MotionOf::nothing)
    form.table("motion", joint.motion, [&](const Form& in, Motion& motion) {
      joints::motion_fields(in, type.motion() == JointType::MotionOf::angle, motion);
    });
  for (const Effect* each : all())
    if (type.is_free() || each->acts_on() == Effect::ActsOn::all_joints ||
        (type.turns_freely() && each->acts_on() == Effect::ActsOn::turns))
      each->joint_fields(form, type.motion() != JointType::MotionOf::length, joint);
  return true;
}

struct JointEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    root.each("joint", scene.joints, one_joint);
  }
  void check(const Scene& scene, Report& report) const override {
    check_connections(scene, scene.joints, "joint", report);
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    std::string text;
    for (const auto& [name, kind] : Words<JointKind>::list) {
      int count = 0;
      for (const Joint& joint : scene.joints) count += joint.kind == kind;
      if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, name);
    }
    if (!text.empty()) lines.push_back({"joints", text});
  }
  void add_columns(const Scene& scene, std::vector<Column>& columns) const override {
    if (!scene.output.forces) return;
    for (std::size_t j = 0; j < scene.joints.size(); ++j) {
      const std::string name = joints::name_of(scene.joints[j], j);
      add_columns_of(
          name + ".f*_N", [j](const Forces& f) { return f.joints[j].force; }, columns);
      add_columns_of(
          name + ".m*_N_m", [j](const Forces& f) { return f.joints[j].moment; }, columns);
      const JointType::MotionOf what = joints::type(scene.joints[j].kind).motion();
      if (what == JointType::MotionOf::nothing) continue;
      const bool angle = what == JointType::MotionOf::angle;
      columns.push_back({name + (angle ? ".drive_N_m" : ".drive_N"),
                         [j](const Diagnostics&, const Forces& f) { return f.joints[j].drive; }});
    }
  }
  void take_lengths(const Scene& scene, Largest& length) const override {
    for (const Joint& joint : scene.joints) {
      const JointType& type = joints::type(joint.kind);
      take_arm(scene, joint.first, joint.at, length);
      take_arm(scene, joint.second, type.point_on_second(joint), length);
      type.take_lengths(joint, length);
    }
  }
  void limit_momenta(Momenta& momenta) const override {
    for (std::size_t j = 0; j < momenta.scene.joints.size(); ++j) {
      const Joint& joint = momenta.scene.joints[j];
      if (!momenta.holds_outside(joint.first, joint.second)) continue;
      const std::string name = joints::name_of(joint, j);
      momenta.push("joint \"" + name + "\"");
      joints::type(joint.kind)
          .limit_axes(joint, momenta, "joint \"" + name + "\" holds from outside");
    }
  }
};

}  // namespace

TETHER_EFFECT(joints, JointEffect)

}  // namespace tether::scene::effects
