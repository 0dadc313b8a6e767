// Tether: surfaces that move on their bodies: belts, tracks, turntables.
// SPDX-License-Identifier: BSD-3-Clause
//
// The material at r from the centre of the body moves with v + w x r against it, both in its axes:
// friction acts against the velocity of the material. Shapes stay where they are.
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

struct SurfaceSpeedEffect : Effect {
  void body_fields(const Form& form, Body& body) const override {
    form.table("surface", body.surface, [](const Form& in, SurfaceSpeed& speed) {
      in.vector("velocity", speed.velocity, kSpeed);
      in.vector("angular_velocity", speed.angular_velocity, kTurning);
      in.require_one("velocity", "angular_velocity",
                     "give velocity (m/s), angular_velocity (rad/s) or both");
    });
  }
  void check_body(const Body& body, Report& report) const override {
    if (body.surface && body.material.empty())
      report.add(body.place, fmt::format("body \"{}\": surface", body.name), "",
                 "has no meaning: the body touches nothing, it has no material");
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "surface speed",
              count_if(scene.bodies, [](const Body& body) { return body.surface.has_value(); }),
              "body");
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    for (const Body& body : scene.bodies) {
      if (!body.surface) continue;
      rate.take(body.surface->velocity.norm() / length);
      rate.take(body.surface->angular_velocity.norm());
    }
  }
};

TETHER_EFFECT(surface_speed, SurfaceSpeedEffect)

}  // namespace tether::scene::effects
