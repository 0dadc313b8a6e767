// Tether: invariants of the motion. SPDX-License-Identifier: BSD-3-Clause
//
// The smooth engine keeps them by projection, see smooth/terms.hpp.
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

struct InvariantEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    root.each("invariant", scene.invariants, [](const Form& form, Invariant& invariant) {
      form.require("kind", "energy, momentum or angular_momentum");
      form.word("kind", invariant.kind);
      form.flag("project", invariant.project);
      return true;
    });
  }
  void check(const Scene& scene, Report& report) const override {
    std::set<InvariantKind> kinds;
    for (const Invariant& each : scene.invariants)
      if (!kinds.insert(each.kind).second)
        report.add(each.place, "invariant: kind", fmt::format("\"{}\"", word(each.kind)),
                   "is named twice");
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    std::string detail;
    for (const Invariant& each : scene.invariants)
      detail += fmt::format("{}{}{}", detail.empty() ? "" : ", ", word(each.kind),
                            each.project ? "" : " (recorded)");
    if (!detail.empty()) lines.push_back({"invariants", detail});
  }
};

TETHER_EFFECT(invariants, InvariantEffect)

}  // namespace tether::scene::effects
