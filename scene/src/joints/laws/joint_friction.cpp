// Tether: friction of joints. SPDX-License-Identifier: BSD-3-Clause
//
// Coulomb's law with a given bound, which does not follow the reactions of the joint.

#include "joints/laws/joint_law_effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

bool rubs(const Joint& joint) { return joint.friction != 0; }

class JointFrictionEffect : public JointLawEffect {
 public:
  JointFrictionEffect() : JointLawEffect("joint friction", rubs) {}
  void read_joint(files::Fields& in, files::Reader&, bool angle, Joint& joint) const override {
    joint.friction = in.number("friction", 0, files::kNotNegative, angle ? "N m" : "N");
  }
  void write_joint(const Joint& joint, bool angle, files::Writer& out) const override {
    out.field("friction", joint.friction, angle ? "N m" : "N");
  }
  void convert(Scene& scene, const Units& units) const override {
    for (Joint& joint : scene.joints)
      joint.friction /= joints::is_angle(joint) ? units.energy() : units.force();
  }
  void add_laws(const Joint& joint, int number, double, JointLawList& out) const override {
    if (rubs(joint)) out.bounded(number, 0, joint.friction);
  }
};

}  // namespace

TETHER_EFFECT(joint_friction, JointFrictionEffect)

}  // namespace tether::scene::effects
