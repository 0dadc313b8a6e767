// Tether: all effects. SPDX-License-Identifier: BSD-3-Clause
#include "list.hpp"

namespace tether::scene::effects {

#define EFFECT(name) const Effect& name##_effect();
#include "effect_list.inc"
#undef EFFECT

const std::vector<const Effect*>& all() {
  static const std::vector<const Effect*> list = {
#define EFFECT(name) &name##_effect(),
#include "effect_list.inc"
#undef EFFECT
  };
  return list;
}

std::vector<std::unique_ptr<mechanics::Force>> make_forces(const Scene& scene,
                                                           const mechanics::Bodies& bodies) {
  std::vector<std::unique_ptr<mechanics::Force>> forces;
  for (const Effect* each : all())
    if (auto force = each->make_force(scene, bodies)) forces.push_back(std::move(force));
  return forces;
}

bool has_joint_laws(const Scene& scene) {
  const auto& list = all();
  return any_of(list, [&](const Effect* each) { return each->has_joint_laws(scene); });
}

bool keeps_energy(const Scene& scene) {
  return !has_joint_laws(scene) &&
         !any_of(all(), [&](const Effect* each) { return each->does_work(scene); }) &&
         !any_of(scene.joints, [](const Joint& each) { return each.window.has_value(); }) &&
         !any_of(scene.bodies, [](const Body& each) { return each.surface.has_value(); }) &&
         !any_of(scene.pairs,
                 [](const Pair& each) { return each.rolling > 0 || each.torsional > 0; });
}

std::vector<double> kinks_of(const Scene& scene) {
  std::vector<double> times;
  for (const Effect* each : all()) each->add_kinks(scene, times);
  sort_unique(times);
  times.erase(times.begin(), std::upper_bound(times.begin(), times.end(), 0.0));
  return times;
}

mechanics::Momenta momenta_of(const Scene& scene) {
  mechanics::Momenta momenta(scene);
  for (const Effect* each : all()) each->limit_momenta(momenta);
  return momenta;
}

}  // namespace tether::scene::effects
