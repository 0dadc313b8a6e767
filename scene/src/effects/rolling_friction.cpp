// Tether: rolling and torsional friction of contacts. SPDX-License-Identifier: BSD-3-Clause
//
// |moment across the normal| <= rolling * normal impulse, |moment about it| <= torsional * normal
// impulse.
#include "mechanics/effect.hpp"
#include "numbers.hpp"

namespace tether::scene::effects {

struct RollingFrictionEffect : Effect {
  void pair_fields(const Form& form, Pair& pair) const override {
    coefficient(form, "rolling", pair.rolling, kMetres);
    coefficient(form, "torsional", pair.torsional, kMetres);
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    const auto any = [&](double Pair::*value) {
      return any_of(scene.pairs, [&](const Pair& pair) { return pair.*value > 0; });
    };
    if (any(&Pair::rolling))
      lines.push_back({"rolling friction", range(scene.pairs, &Pair::rolling) + " m"});
    if (any(&Pair::torsional))
      lines.push_back({"torsional friction", range(scene.pairs, &Pair::torsional) + " m"});
  }
  void configure_pair(const Pair& pair, contact::Meeting& meeting) const override {
    meeting.rolling = pair.rolling;
    meeting.torsional = pair.torsional;
  }
};

TETHER_EFFECT(rolling_friction, RollingFrictionEffect)

}  // namespace tether::scene::effects
