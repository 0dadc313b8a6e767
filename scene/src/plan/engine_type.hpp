// Tether: what plans ask of an engine. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/plan.hpp>

namespace tether::scene {

/// One for each kind of engine but `automatic`, in a file of its own: <kind>_engine().
struct EngineType {
  EngineKind kind;
  /// Throws std::invalid_argument, naming what the scene asks for and the engine does not have.
  std::unique_ptr<Engine> (*make)(const Scene&);
  /// Their number in a plan that has all else.
  int (*unknowns)(const Scene&, const Plan&);
  /// Gives the scene the options that it would have by default. `motion_alone`: those that change
  /// no bit of the motion are set to their defaults, too.
  void (*spell_out)(Scene&, bool motion_alone);
};

/// Throws std::invalid_argument where there is none.
TETHER_EXPORT_BEGIN
const EngineType& engine_type(EngineKind kind);
TETHER_EXPORT_END

}  // namespace tether::scene
