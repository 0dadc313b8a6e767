// Tether: the saved state as an output; the run writes it. SPDX-License-Identifier: BSD-3-Clause
#include "formats.hpp"

namespace tether::scene::formats {

const Format& state_format() {
  static const Format format{"state", ".state", "Saved state: at checkpoints and at the end"};
  return format;
}

}  // namespace tether::scene::formats
