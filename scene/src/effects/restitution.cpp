// Tether: restitution of impacts. SPDX-License-Identifier: BSD-3-Clause
//
// Newton's law: normal velocity after an impact = -restitution * the one before; Poisson's: the
// same of impulses.
#include "mechanics/effect.hpp"
#include "numbers.hpp"

namespace tether::scene::effects {

struct RestitutionEffect : Effect {
  void pair_fields(const Form& form, Pair& pair) const override {
    if (form.in() || pair.touch) form.number("restitution", pair.restitution, kPart);
  }
  void plan(const Scene& scene, EngineKind kind, Lines& lines) const override {
    const bool limits =
        any_of(scene.joints, [](const Joint& joint) { return joint.limits.has_value(); });
    if (kind != EngineKind::smooth && (limits || !scene.pairs.empty()))
      lines.push_back({"impacts", simultaneous_impacts_text(scene)});
    if (any_of(scene.pairs, [](const Pair& pair) { return pair.restitution > 0; }))
      lines.push_back({"restitution", range(scene.pairs, &Pair::restitution)});
  }
  void configure_pair(const Pair& pair, contact::Meeting& meeting) const override {
    meeting.restitution = pair.restitution;
  }
};

TETHER_EFFECT(restitution, RestitutionEffect)

}  // namespace tether::scene::effects
