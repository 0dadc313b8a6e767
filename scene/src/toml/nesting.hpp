// Tether: how deep a TOML text nests, before it is parsed. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string_view>

namespace tether::scene::files {

/// Tables and arrays inside each other; a dotted key or header counts for all its parts, which the
/// parser's own limit does not see though each is a table that it recurses into.
struct Nesting {
  int depth = 0;             ///< the deepest
  int line = 1, column = 1;  ///< where it is reached first
};

constexpr int kDeepest = 64;

/// Stops looking beyond kDeepest. Of a text that is not TOML it may say anything: no deeper than
/// the part that the parser reads before it refuses.
Nesting nesting_of(std::string_view text);

}  // namespace tether::scene::files
