// Tether: numbers of messages. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <charconv>
#include <locale>
#include <sstream>
#include <string>
#include <vector>

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

/// "a, b and c"; of more than six names the others are counted.
inline std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t kNamed = 6;
  std::string out;
  const std::size_t shown = std::min(names.size(), kNamed);
  for (std::size_t k = 0; k < shown; ++k)
    out += (k == 0 ? "" : k + 1 < names.size() ? ", " : " and ") + names[k];
  if (shown < names.size()) out += " and " + std::to_string(names.size() - shown) + " more";
  return out;
}

/// The same of unknowns: "y[0] and y[3]".
inline std::string listed(const std::vector<int>& unknowns) {
  std::vector<std::string> names;
  for (const int j : unknowns) names.push_back("y[" + std::to_string(j) + "]");
  return listed(names);
}

/// Writes numbers the same in every locale that the host may have made the global one.
struct PlainText : std::ostringstream {
  PlainText() { imbue(std::locale::classic()); }
};

}  // namespace tether::ida_projection
