// Tether: half a turn in radians. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::linalg {

/// C++17 has none.
inline constexpr double kPi = 3.14159265358979323846;

}  // namespace tether::linalg
