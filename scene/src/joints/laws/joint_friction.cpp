// Tether: friction of joints. SPDX-License-Identifier: BSD-3-Clause
//
// Coulomb's law with a given bound, which does not follow the reactions of the joint.
#include "joints/laws/joint_law_effect.hpp"

namespace tether::scene::effects {

namespace {

bool rubs(const Joint& joint) { return joint.friction != 0; }

struct JointFrictionEffect : JointLawEffect {
  JointFrictionEffect() : JointLawEffect("joint friction", rubs) {}
  void joint_fields(const Form& form, bool angle, Joint& joint) const override {
    form.number("friction", joint.friction, kNotNegative, angle ? kMoment : kForce);
  }
  void add_laws(const Joint& joint, int number, double, JointLawList& out) const override {
    if (rubs(joint)) out.bounded(number, 0, joint.friction);
  }
};

}  // namespace

TETHER_EFFECT(joint_friction, JointFrictionEffect)

}  // namespace tether::scene::effects
