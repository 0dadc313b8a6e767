// Tether: the stepping engine as plans see it. SPDX-License-Identifier: BSD-3-Clause
#include "plan/engine_type.hpp"

namespace tether::scene {

namespace {

int stepping_unknowns(const Scene&, const Plan& plan) { return 6 * plan.moving; }

void spell_out_stepping(Scene& scene, bool motion_alone) {
  if (!scene.stepping) scene.stepping.emplace();
  if (!motion_alone) return;
  scene.stepping->threads = 1;
  scene.stepping->on_failure = OnFailure::stop;
}

}  // namespace

const EngineType& stepping_engine() {
  static const EngineType type{EngineKind::stepping, make_stepping_engine, stepping_unknowns,
                               spell_out_stepping};
  return type;
}

}  // namespace tether::scene
