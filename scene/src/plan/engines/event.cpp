// Tether: the event engine as plans see it. SPDX-License-Identifier: BSD-3-Clause
#include "plan/engine_type.hpp"

namespace tether::scene {

namespace {

std::unique_ptr<Engine> make_events(const Scene& scene) {
  return goes_on_in_steps(scene) ? make_event_engine_with_steps(scene) : make_event_engine(scene);
}

int event_unknowns(const Scene&, const Plan& plan) { return 13 * plan.moving + 1; }

void spell_out_event(Scene& scene, bool motion_alone) {
  if (!scene.event) scene.event.emplace();
  if (!motion_alone) return;
  const EventOptions by_default;
  scene.event->max_steps = by_default.max_steps;
  scene.event->max_events = by_default.max_events;
  scene.event->otherwise = Otherwise::stop;
  if (scene.stepping) scene.stepping->threads = 1;
}

}  // namespace

const EngineType& event_engine() {
  static const EngineType type{EngineKind::event, make_events, event_unknowns, spell_out_event};
  return type;
}

}  // namespace tether::scene
