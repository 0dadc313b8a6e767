// Tether: friction of contacts. SPDX-License-Identifier: BSD-3-Clause
//
// |tangential impulse| <= friction * normal impulse, by the law of [stepping].
//
// With static_friction a contact without slip holds where static_friction * normal impulse can hold
// it. One that slips has the smaller coefficient until its slip ends, and impacts have it, too.
// Both laws take energy only. With friction_across the ellipse of contacts that hold is that of
// contacts that slip, times static_friction / friction.
#include "mechanics/effect.hpp"
#include "numbers.hpp"

namespace tether::scene::effects {

struct FrictionEffect : Effect {
  void pair_fields(const Form& form, Pair& pair) const override {
    if (form.in() || pair.touch) coefficient(form, "friction", pair.friction, {});
    constexpr const char* kKey = "static_friction";
    Fields* const in = form.in();
    if (in && in->has(kKey)) pair.static_friction = pair.friction;  // stands for what is wrong
    if (!pair.static_friction) return;
    coefficient(form, kKey, *pair.static_friction, {});
    if (!in) return;
    if (!pair.touch) in->wrong(kKey, "is of a contact, and touch = false has none");
    if (*pair.static_friction < pair.friction)
      in->wrong(kKey, fmt::format("must be at least friction, {}", pair.friction));
    if (pair.friction == 0 && in->has("friction_across"))
      in->wrong(kKey, "scales friction and friction_across: with the latter, friction must be > 0");
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    const contact::Law law = scene.stepping.value_or(SteppingOptions{}).law;
    if (law == contact::Law::frictionless ||
        !any_of(scene.pairs, [](const Pair& pair) { return pair.friction > 0; }))
      return;
    lines.push_back(
        {"friction", fmt::format("{}, law {}", range(scene.pairs, &Pair::friction), word(law))});
    add_count(
        lines, "static friction",
        count_if(scene.pairs, [](const Pair& each) { return each.static_friction.has_value(); }),
        "pair", " of materials");
  }
  void configure_pair(const Pair& pair, contact::Meeting& meeting) const override {
    meeting.friction = pair.friction;
    meeting.static_friction = pair.static_friction;
  }
};

TETHER_EFFECT(friction, FrictionEffect)

}  // namespace tether::scene::effects
