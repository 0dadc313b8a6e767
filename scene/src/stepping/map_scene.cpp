// Tether: a scene as bodies, surfaces and meetings of the contact library.
// SPDX-License-Identifier: BSD-3-Clause
#include "map_scene.hpp"

#include <map>
#include <stdexcept>
#include <string>

#include "effects/list.hpp"

namespace tether::scene::stepping {

namespace {

void refuse(const Scene& scene) {
  for (const Invariant& each : scene.invariants)
    if (each.project)
      throw std::invalid_argument(
          "the stepping engine projects no invariants: give them project = false, or, without "
          "contacts, use the smooth engine");
}

// Materials that no pair names get none, so that their bodies have no surfaces at all.
std::map<std::string, int> materials(const Scene& scene) {
  std::map<std::string, int> index;
  for (const Pair& pair : scene.pairs) {
    if (!pair.touch) continue;
    index.emplace(pair.first, static_cast<int>(index.size()));
    index.emplace(pair.second, static_cast<int>(index.size()));
  }
  return index;
}

}  // namespace

Mapped map_scene(const Scene& scene) {
  refuse(scene);
  Mapped out;
  const std::map<std::string, int> material = materials(scene);
  for (const Body& body : scene.bodies) {
    const std::string where = "body \"" + body.name + "\": ";
    int index = 0;
    try {
      index = body.fixed ? out.bodies.add_fixed(body.position, body.orientation)
                         : out.bodies.add(body.mass, body.inertia, body.position, body.orientation,
                                          body.velocity, body.angular_velocity);
    } catch (const std::invalid_argument& problem) {
      throw std::invalid_argument(where + problem.what());
    }
    const auto found = material.find(body.material);
    if (found == material.end()) continue;
    const SurfaceSpeed speed = body.surface.value_or(SurfaceSpeed{});
    for (const Shape& shape : body.shapes)
      out.surfaces.push_back({index, shape, found->second, speed.velocity, speed.angular_velocity});
  }
  for (const Pair& pair : scene.pairs) {
    if (!pair.touch) continue;
    contact::Meeting meeting;
    meeting.first = material.at(pair.first);
    meeting.second = material.at(pair.second);
    for (const effects::Effect* each : effects::all()) each->configure_pair(pair, meeting);
    out.meetings.push_back(meeting);
  }

  out.options = scene.stepping.value_or(SteppingOptions{});
  out.options.gravity.reset();
  out.options.simultaneous_impacts = scene.simultaneous_impacts;
  for (const effects::Effect* each : effects::all()) each->configure(scene, out.options);
  return out;
}

}  // namespace tether::scene::stepping
