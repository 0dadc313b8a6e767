// Tether: the size of rounding. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

namespace tether::ida_projection {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

}  // namespace tether::ida_projection
