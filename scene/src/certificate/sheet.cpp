// Tether: the certificate of a run as it is written. SPDX-License-Identifier: BSD-3-Clause
#include "sheet.hpp"

#include "joint_lines.hpp"
#include "told.hpp"

namespace tether::scene::certificate {

Line& Line::operator<<(std::string_view text) {
  out_ += ' ';
  for (const char c : text) out_ += c == '\n' || c == '\r' ? ' ' : c;
  return *this;
}

namespace {

void put_body(int number, const Body& body, int material, std::string& out) {
  const SurfaceSpeed speed = body.surface.value_or(SurfaceSpeed{});
  Line line(out, "body");
  line << number << (body.fixed ? 0.0 : body.mass);
  for (int i = 0; i < 3; ++i) line << Vector3d(body.inertia.col(i));
  line << body.position << body.orientation.normalized() << material << speed.velocity
       << speed.angular_velocity << body.friction_axis.value_or(Vector3d::Zero()) << body.name;
}

}  // namespace

Friction friction(const Scene& scene, int first, int second, const std::vector<BodyState>& states) {
  const contact::Law law = scene.stepping.value_or(SteppingOptions{}).law;
  Friction out;
  out.associated = law == contact::Law::maximum_dissipation;
  if (law == contact::Law::frictionless) return out;
  for (const Pair& pair : scene.pairs)
    for (const auto& [a, b] : {std::pair(first, second), std::pair(second, first)}) {
      const Body &body = scene.bodies[at(a)], &other = scene.bodies[at(b)];
      if (body.material != pair.first || other.material != pair.second) continue;
      out.along = pair.friction;
      out.across = pair.friction_across.value_or(pair.friction);
      out.holds = pair.static_friction.value_or(0);
      if (pair.is_elliptic())
        out.axis = states[at(a)].orientation * body.friction_axis.value_or(Vector3d::Zero());
      return out;
    }
  return out;
}

Sheet::Sheet(const Scene& scene) {
  std::string out = std::string(kCertificateHead) + "1\n" + kForms;
  std::map<std::string, int> materials;
  for (const Pair& pair : scene.pairs)
    for (const std::string& each : {pair.first, pair.second})
      materials.emplace(each, static_cast<int>(materials.size()));
  Body world;
  world.fixed = true;
  world.name = "the world";
  put_body(-1, world, -1, out);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const auto material = materials.find(scene.bodies[b].material);
    put_body(static_cast<int>(b), scene.bodies[b],
             material == materials.end() ? -1 : material->second, out);
  }
  for (const Pair& pair : scene.pairs)
    if (pair.touch)
      Line(out, "pair") << materials[pair.first] << materials[pair.second] << pair.friction
                        << pair.friction_across.value_or(pair.friction)
                        << pair.static_friction.value_or(0) << pair.restitution << pair.rolling
                        << pair.torsional;
  put(out);
}

void Sheet::begin(const Scene& scene, const char* engine, Source& source) {
  flush();
  source_ = &source;
  std::string out;
  const SteppingOptions stepping = scene.stepping.value_or(SteppingOptions{});
  Line(out, "engine") << scene.gravity.value_or(Vector3d::Zero()) << stepping.accuracy << engine
                      << contact::name(stepping.gyroscopic) << contact::name(stepping.law);
  if (!scene.joints.empty()) JointLines(scene).put_rows(scene, out);
  put(out);
}

}  // namespace tether::scene::certificate
