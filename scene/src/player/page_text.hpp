// Tether: values of a page: JSON that may stand inside HTML, and numbers in base 64.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace tether::scene::player {

/// In ASCII without a character that means something to HTML. Bytes that are not UTF-8 become
/// U+FFFD, numbers that JSON lacks null.
std::string script_text(const nlohmann::json& value);

/// The page up to its body. Its policy lets it load nothing and send nothing, whatever its texts
/// say.
std::string page_head(const std::string& title, std::string_view style);

/// Little-endian, in base 64.
std::string base64(const std::vector<float>& values);
std::string base64(const std::vector<std::int16_t>& values);

/// Made at configuration from the files in `page`.
extern const std::string_view kStyle, kBody, kScript;

// The page of `tether cost`.
extern const std::string_view kCostStyle;

}  // namespace tether::scene::player
