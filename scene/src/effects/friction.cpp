// Tether: friction of contacts. SPDX-License-Identifier: BSD-3-Clause
//
// |tangential impulse| <= friction * normal impulse, by the law of [stepping].

#include "mechanics/effect.hpp"
#include "numbers.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

class FrictionEffect : public Effect {
 public:
  void pair_fields(const files::Form& form, Pair& pair) const override {
    if (form.in() || pair.touch) coefficient(form, "friction", pair.friction, {});
  }
  void plan(const Scene& scene, EngineKind, std::vector<PlannedEffect>& lines) const override {
    const contact::Law law = scene.stepping.value_or(SteppingOptions{}).law;
    if (law == contact::Law::frictionless ||
        !any_of(scene.pairs, [](const Pair& pair) { return pair.friction > 0; }))
      return;
    lines.push_back(
        {"friction", fmt::format("{}, law {}", range(scene.pairs, &Pair::friction), word(law))});
  }
  void configure_pair(const Pair& pair, contact::Meeting& meeting) const override {
    meeting.friction = pair.friction;
  }
};

}  // namespace

TETHER_EFFECT(friction, FrictionEffect)

}  // namespace tether::scene::effects
