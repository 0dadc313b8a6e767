// Tether: the scenes that `tether new` writes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>
#include <vector>

namespace tether::scene {

struct Kind {
  std::string_view name, text;
};

/// Made at configuration from the files in `kinds`.
const std::vector<Kind>& kinds();

}  // namespace tether::scene
