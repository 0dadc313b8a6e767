// Tether: numbers of messages. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <string>

namespace tether::ida_projection {

/// The fewest digits that give the same number again, the same in every locale: std::to_string has
/// none left of 1e-9.
inline std::string shortest(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

}  // namespace tether::ida_projection
