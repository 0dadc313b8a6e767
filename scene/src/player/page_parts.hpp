// Tether: the fixed parts of the page that plays a run. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace tether::scene::player {

/// Made at configuration from the files in `page`.
extern const std::string_view kStyle, kBody, kScript;

// The page of `tether cost`.
extern const std::string_view kCostStyle;
extern const std::string_view kCostScript;

}  // namespace tether::scene::player
