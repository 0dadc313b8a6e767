// Tether: the saved state as an output; the run writes it. SPDX-License-Identifier: BSD-3-Clause
#include "formats.hpp"

namespace tether::scene::formats {

TETHER_FORMAT(state, ".state", "Saved state: at checkpoints and at the end")

}  // namespace tether::scene::formats
