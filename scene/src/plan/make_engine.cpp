// Tether: the engine of a scene. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/plan.hpp>

namespace tether::scene {

bool goes_on_in_steps(const Scene& scene) {
  return scene.event.value_or(EventOptions{}).otherwise == Otherwise::stepping;
}

std::unique_ptr<Engine> make_engine(const Scene& scene, const Plan& plan) {
  switch (plan.engine) {
    case EngineKind::smooth:
      return make_smooth_engine(scene);
    case EngineKind::stepping:
      return make_stepping_engine(scene);
    case EngineKind::event:
      return goes_on_in_steps(scene) ? make_event_engine_with_steps(scene)
                                     : make_event_engine(scene);
  }
  return nullptr;
}

std::unique_ptr<Engine> make_engine(const Scene& scene) {
  return make_engine(scene, make_plan(scene));
}

}  // namespace tether::scene
