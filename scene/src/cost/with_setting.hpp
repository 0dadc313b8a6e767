// Tether: a scene with another setting. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/cost.hpp>

namespace tether::scene::costs {

/// The scene with one setting, and nothing written.
Scene with_setting(const Scene& scene, CostMethod method, double setting);

}  // namespace tether::scene::costs
