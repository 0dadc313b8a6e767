// Tether: friction of joints. SPDX-License-Identifier: BSD-3-Clause
//
// Coulomb's law with a given bound, which does not follow the reactions of the joint.
#include <algorithm>
#include <cmath>

#include "joints/list.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

bool rubs(const Joint& joint) { return joint.friction != 0; }

class JointFrictionEffect : public Effect {
 public:
  void read_joint(files::Fields& in, files::Reader&, bool angle, Joint& joint) const override {
    joint.friction = in.number("friction", 0, files::kNotNegative, angle ? "N m" : "N");
  }
  void write_joint(const Joint& joint, bool angle, files::Writer& out) const override {
    out.field("friction", joint.friction, angle ? "N m" : "N");
  }
  void plan(const Scene& scene, EngineKind, std::vector<PlannedEffect>& lines) const override {
    const auto count = std::count_if(scene.joints.begin(), scene.joints.end(), rubs);
    if (count > 0)
      lines.push_back({"joint friction", fmt::format("{} joint{}", count, count == 1 ? "" : "s")});
  }
  void convert(Scene& scene, const Units& units) const override {
    for (Joint& joint : scene.joints)
      joint.friction /= joints::is_angle(joint) ? units.energy() : units.force();
  }
  void add_laws(const Joint& joint, int number, double, JointLawList& out) const override {
    if (rubs(joint)) out.bounded(number, 0, joint.friction);
  }
  bool has_joint_laws(const Scene& scene) const override {
    return std::any_of(scene.joints.begin(), scene.joints.end(), rubs);
  }
};

}  // namespace

const Effect& joint_friction_effect() {
  static const JointFrictionEffect effect;
  return effect;
}

}  // namespace tether::scene::effects
