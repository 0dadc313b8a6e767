// Tether: indices of bodies and rows, as containers take them. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/index.hpp>

namespace tether::scene::mechanics {

using linalg::at;

}  // namespace tether::scene::mechanics
