// Tether: words that are safe to show and to name things by. SPDX-License-Identifier: BSD-3-Clause
#include "report.hpp"

namespace tether::scene {

std::string files::printable(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = [&](std::size_t k) {
      return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u;
    };
    const unsigned first = byte(0), second = byte(1), third = byte(2);
    // In UTF-8: U+0080 to U+009F, U+2028 to U+202E, U+2066 to U+2069.
    const bool c1 = first == 0xc2 && second >= 0x80 && second < 0xa0;
    const bool turns = first == 0xe2 && ((second == 0x80 && third >= 0xa8 && third <= 0xae) ||
                                         (second == 0x81 && third >= 0xa6 && third <= 0xa9));
    const bool shows = first >= 0x20 && first != 0x7f && !c1 && !turns;
    out += shows ? text[i] : '?';
    i += c1 ? 1 : turns ? 2 : 0;
  }
  return out;
}

bool files::is_plain(std::string_view text) {
  return text.size() <= kLongestPlain && text.find_first_of("\",") == std::string_view::npos &&
         printable(text) == text &&
         (text.empty() || std::string_view("=+-@").find(text[0]) == std::string_view::npos);
}

}  // namespace tether::scene
