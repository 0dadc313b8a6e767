// Tether: surfaces that move on their bodies: belts, tracks, turntables.
// SPDX-License-Identifier: BSD-3-Clause
//
// The material at r from the centre of the body moves with v + w x r against it, both in its axes:
// friction acts against the velocity of the material. Shapes stay where they are.
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

class SurfaceSpeedEffect : public Effect {
 public:
  void read_body(files::Fields& in, files::Reader& r, Body& body) const override {
    const files::Value* table = in.table("surface");
    if (table == nullptr) return;
    files::Fields fields = r.fields(table, in.path() + ": surface");
    SurfaceSpeed& speed = body.surface.emplace();
    speed.velocity = fields.vector("velocity", speed.velocity, files::kAny, "m/s");
    speed.angular_velocity =
        fields.vector("angular_velocity", speed.angular_velocity, files::kAny, "rad/s");
    if (!fields.has("velocity") && !fields.has("angular_velocity"))
      fields.missing("velocity", "give velocity (m/s), angular_velocity (rad/s) or both");
    fields.finish();
  }
  void write_body(const Body& body, files::Writer& out) const override {
    if (!body.surface) return;
    const auto list = [](const Vector3d& v) {
      return fmt::format("[{}, {}, {}]", files::toml(v.x()), files::toml(v.y()),
                         files::toml(v.z()));
    };
    out.raw("surface",
            fmt::format("{{ velocity = {}, angular_velocity = {} }}", list(body.surface->velocity),
                        list(body.surface->angular_velocity)));
  }
  void check_body(const Body& body, files::Report& report) const override {
    if (body.surface && body.material.empty())
      report.add(body.place, fmt::format("body \"{}\": surface", body.name), "",
                 "has no meaning: the body touches nothing, it has no material");
  }
  void plan(const Scene& scene, EngineKind, std::vector<PlannedEffect>& lines) const override {
    int count = 0;
    for (const Body& body : scene.bodies) count += body.surface.has_value();
    if (count > 0)
      lines.push_back(
          {"surface speed", fmt::format("{} {}", count, count == 1 ? "body" : "bodies")});
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    for (const Body& body : scene.bodies) {
      if (!body.surface) continue;
      rate.take(body.surface->velocity.norm() / length);
      rate.take(body.surface->angular_velocity.norm());
    }
  }
  void convert(Scene& scene, const Units& units) const override {
    for (Body& body : scene.bodies) {
      if (!body.surface) continue;
      body.surface->velocity /= units.speed();
      body.surface->angular_velocity *= units.time;
    }
  }
};

}  // namespace

TETHER_EFFECT(surface_speed, SurfaceSpeedEffect)

}  // namespace tether::scene::effects
