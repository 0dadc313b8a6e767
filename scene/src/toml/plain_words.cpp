// Tether: words that are safe to show and to name things by. SPDX-License-Identifier: BSD-3-Clause
#include "report.hpp"

namespace tether::scene {

std::size_t files::character_at(std::string_view text) {
  const auto byte = [&](std::size_t k) {
    return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u;
  };
  const unsigned first = byte(0);
  const std::size_t count = first < 0x80                    ? 1
                            : first >= 0xc2 && first < 0xe0 ? 2
                            : first >= 0xe0 && first < 0xf0 ? 3
                            : first >= 0xf0 && first < 0xf5 ? 4
                                                            : 0;
  for (std::size_t k = 1; k < count; ++k)
    if ((byte(k) & 0xc0u) != 0x80) return 0;
  // Longer than needed, half of a pair, beyond the last one, or no character of XML.
  if ((first == 0xe0 && byte(1) < 0xa0) || (first == 0xed && byte(1) >= 0xa0) ||
      (first == 0xf0 && byte(1) < 0x90) || (first == 0xf4 && byte(1) >= 0x90) ||
      (first == 0xef && byte(1) == 0xbf && byte(2) >= 0xbe))
    return 0;
  return count;
}

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

namespace {

/// Signs of ASCII for their full-width forms (U+FF01 to U+FF5E) and the minus sign (U+2212), a
/// question mark for small forms (U+FE50 to U+FE6F), blanks for what shows as one or as nothing
/// (U+00A0, U+2000 to U+200F, U+202F, U+205F to U+2064, U+3000, U+FEFF).
std::string in_ascii(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = [&](std::size_t k) {
      return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u;
    };
    const unsigned lead = byte(0) << 8 | byte(1), last = byte(2);
    char sign = 0;
    if (lead == 0xefbc && last > 0x80 && last <= 0xbf) sign = static_cast<char>(last - 0x60);
    if (lead == 0xefbd && last >= 0x80 && last < 0x9f) sign = static_cast<char>(last - 0x20);
    if (lead == 0xefb9 && last >= 0x90 && last < 0xb0) sign = '?';
    if (lead == 0xe288 && last == 0x92) sign = '-';
    if ((lead == 0xe280 && (last < 0x90 || last == 0xaf)) ||
        (lead == 0xe281 && last >= 0x9f && last <= 0xa4) || (lead == 0xe380 && last == 0x80) ||
        (lead == 0xefbb && last == 0xbf))
      sign = ' ';
    out += lead == 0xc2a0 ? ' ' : sign != 0 ? sign : text[i];
    i += lead == 0xc2a0 ? 1 : sign != 0 ? 2 : 0;
  }
  return out;
}

}  // namespace

bool files::is_name(std::string_view text) {
  const std::string read = in_ascii(text);
  return is_plain(text) && is_plain(read) &&
         read.find_first_of(";$`()&|<>\\!*?'") == std::string::npos &&
         (read.empty() || read[0] != ' ');
}

bool files::is_plain(std::string_view text) {
  return text.size() <= kLongestPlain && text.find_first_of("\",") == std::string_view::npos &&
         printable(text) == text &&
         (text.empty() || std::string_view("=+-@").find(text[0]) == std::string_view::npos);
}

}  // namespace tether::scene
