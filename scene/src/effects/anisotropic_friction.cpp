// Tether: friction that depends on the direction: skis, skates, wheels, wood.
// SPDX-License-Identifier: BSD-3-Clause
//
// With the coefficients mu_1 along and mu_2 across an axis of one body, x_n the normal impulse:
//
//   (x_1 / mu_1)^2 + (x_2 / mu_2)^2 <= x_n^2,   the slip is along the normal of the ellipse
//
// which is Coulomb's law for the tangents t_k mu_k / mu, mu the larger of both.
#include "mechanics/effect.hpp"
#include "numbers.hpp"

namespace tether::scene::effects {

struct AnisotropicFriction : Effect {
  void body_fields(const Form& form, Body& body) const override {
    form.direction("friction_axis", body.friction_axis);
  }
  void pair_fields(const Form& form, Pair& pair) const override {
    constexpr const char* kKey = "friction_across";
    coefficient(form, kKey, pair.friction_across);
    if (!form.in() || !pair.friction_across) return;
    if (!pair.touch) form.in()->wrong(kKey, "is of a contact, and touch = false has none");
    if (pair.first == pair.second && !pair.first.empty())
      form.in()->wrong(kKey, "is of two materials: bodies of the first one have the friction_axis");
  }
  void check(const Scene& scene, Report& report) const override {
    std::set<std::string> with_axis;
    for (const Pair& pair : scene.pairs)
      if (pair.friction_across) with_axis.insert(pair.first);
    for (const Body& body : scene.bodies) {
      const bool wanted = with_axis.count(body.material) > 0;
      if (wanted == body.friction_axis.has_value()) continue;
      report.add(body.place, fmt::format("body \"{}\": friction_axis", body.name), "",
                 wanted ? "is missing: a [[pair]] with friction_across names its material first"
                        : "has no meaning: no [[pair]] with friction_across names its material "
                          "first");
    }
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "elliptic friction",
              count_if(scene.pairs, [](const Pair& each) { return each.is_elliptic(); }), "pair",
              " of materials");
  }
  void configure_pair(const Pair& pair, contact::Meeting& meeting) const override {
    meeting.friction_across = pair.friction_across;
  }
};

TETHER_EFFECT(anisotropic_friction, AnisotropicFriction)

}  // namespace tether::scene::effects
