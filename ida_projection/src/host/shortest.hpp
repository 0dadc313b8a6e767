// Tether: numbers of messages. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <locale>
#include <sstream>
#include <string>

namespace tether::ida_projection {

/// The fewest digits that give the same number again, in every locale. std::to_string would give 0
/// for 1e-9, and a comma in some locales.
inline std::string shortest(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// Six digits of what was measured, the same in every locale.
inline std::string brief(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, 6).ptr};
}

/// Writes numbers the same in every locale that the host may have made the global one.
struct PlainText : std::ostringstream {
  PlainText() { imbue(std::locale::classic()); }
};

}  // namespace tether::ida_projection
