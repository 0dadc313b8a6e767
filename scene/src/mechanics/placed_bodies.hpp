// Tether: the bodies of a scene in their first places. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

#include "bodies.hpp"

namespace tether::scene::mechanics {

/// Frames of all bodies and, last, of the world: positions and attitudes of the scene, at rest; no
/// inertia, and nothing moves yet.
Bodies placed_bodies(const Scene& scene);

}  // namespace tether::scene::mechanics
