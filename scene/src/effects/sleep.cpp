// Tether: islands of bodies at rest that steps leave out. SPDX-License-Identifier: BSD-3-Clause
//
// The contact library's steps do it (docs/method/contact.md, section 7.1); other engines have none.
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

struct SleepEffect : Effect {
  void plan(const Scene& scene, EngineKind engine, Lines& lines) const override {
    const double sleep = scene.stepping.value_or(SteppingOptions{}).sleep;
    if (engine != EngineKind::stepping || !(sleep > 0)) return;
    lines.push_back(
        {"sleep", fmt::format("islands slower than {} sqrt(g s) for 5 sqrt(s / g)", sleep)});
  }
};

TETHER_EFFECT(sleep, SleepEffect)

}  // namespace tether::scene::effects
