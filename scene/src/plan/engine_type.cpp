// Tether: all engines. SPDX-License-Identifier: BSD-3-Clause
#include "engine_type.hpp"

#include <tether/scene/words.hpp>

#include "switching/switching.hpp"

namespace tether::scene {

#define ENGINE(name) const EngineType& name##_engine();
#include "engine_list.inc"
#undef ENGINE

const EngineType& engine_type(EngineKind kind) {
  static const EngineType* const all[] = {
#define ENGINE(name) &name##_engine(),
#include "engine_list.inc"
#undef ENGINE
  };
  for (const EngineType* each : all)
    if (each->kind == kind) return *each;
  throw std::invalid_argument("the plan names no engine");
}

std::unique_ptr<Engine> make_engine(const Scene& scene, const Plan& plan) {
  return with_switching(scene, engine_type(plan.engine).make);
}

std::unique_ptr<Engine> make_engine(const Scene& scene) {
  return make_engine(scene, make_plan(scene));
}

}  // namespace tether::scene
