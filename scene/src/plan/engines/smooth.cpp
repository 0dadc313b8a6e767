// Tether: the smooth engine as plans see it. SPDX-License-Identifier: BSD-3-Clause
#include "effects/list.hpp"
#include "plan/engine_type.hpp"

namespace tether::scene {

namespace {

// Unknowns of IDA: position, quaternion and velocities of each body, the work of forces if energy
// is kept in spite of them, and multipliers as the formulation has them.
int smooth_unknowns(const Scene& s, const Plan& plan) {
  const bool keeps_energy = any_of(s.invariants, [](const Invariant& each) {
    return each.project && each.kind == InvariantKind::energy;
  });
  const bool works =
      any_of(effects::all(), [&](const effects::Effect* each) { return each->does_work(s); });
  const Formulation form = s.smooth.value_or(SmoothOptions{}).formulation;
  const int multipliers = form == Formulation::index1 ? 1 : 0;
  return 13 * plan.moving + (keeps_energy && works ? 1 : 0) + multipliers * plan.rows;
}

void spell_out_smooth(Scene& scene, bool motion_alone) {
  if (!scene.smooth) scene.smooth.emplace();
  if (motion_alone) scene.smooth->max_steps = SmoothOptions{}.max_steps;
}

}  // namespace

const EngineType& smooth_engine() {
  static const EngineType type{EngineKind::smooth, make_smooth_engine, smooth_unknowns,
                               spell_out_smooth};
  return type;
}

}  // namespace tether::scene
