// Tether: elements of a scene that stand for many. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "toml/document.hpp"

namespace tether::scene::files {

constexpr std::size_t kMostElements = 100000;  // that one scene may have by repetition
constexpr std::size_t kMostCopied = 3000000;   // values of TOML in them, some hundred bytes each
constexpr std::size_t kBytesOfValue = 100;     // of texts that count as one value more

/// Replaces each [[body]], [[joint]], [[spring]] and [[load]] that has `repeat` by its copies.
/// Throws SceneError where a repetition is wrong or makes too many.
void repeat_elements(Value& document, const std::string& file);

}  // namespace tether::scene::files
