// Tether: invariants of the motion. SPDX-License-Identifier: BSD-3-Clause
//
// The smooth engine keeps them by projection, see smooth/kept_invariants.hpp.

#include "mechanics/effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

class InvariantEffect : public Effect {
 public:
  void read(files::Fields& root, files::Reader& r) const override {
    r.each(root, "invariant", [&](files::Fields& in) {
      Invariant invariant;
      invariant.place = in.place();
      if (!in.has("kind")) in.missing("kind", "energy, momentum or angular_momentum");
      invariant.kind = in.word("kind", invariant.kind);
      invariant.project = in.flag("project", invariant.project);
      r.scene.invariants.push_back(invariant);
    });
  }
  void write(const Scene& scene, files::Writer& out) const override {
    for (const Invariant& each : scene.invariants) {
      out.item("invariant");
      out.raw("kind", files::toml_word(each.kind));
      out.field("project", each.project);
    }
  }
  void check(const Scene& scene, files::Report& report) const override {
    std::set<InvariantKind> kinds;
    for (const Invariant& each : scene.invariants)
      if (!kinds.insert(each.kind).second)
        report.add(each.place, "invariant: kind", fmt::format("\"{}\"", word(each.kind)),
                   "is named twice");
  }
  void plan(const Scene& scene, EngineKind, std::vector<PlannedEffect>& lines) const override {
    std::string detail;
    for (const Invariant& each : scene.invariants)
      detail += fmt::format("{}{}{}", detail.empty() ? "" : ", ", word(each.kind),
                            each.project ? "" : " (recorded)");
    if (!detail.empty()) lines.push_back({"invariants", detail});
  }
};

}  // namespace

TETHER_EFFECT(invariants, InvariantEffect)

}  // namespace tether::scene::effects
