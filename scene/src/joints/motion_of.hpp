// Tether: the quantity that a motion of a joint prescribes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::scene::joints {

enum class MotionOf { nothing, angle, length };

}  // namespace tether::scene::joints
