// Tether: text for terminals and tables. SPDX-License-Identifier: BSD-3-Clause
#include "program/terminal_text.hpp"

#include "toml/report.hpp"

namespace tether::scene {

std::string on_terminal(std::string_view text) {
  std::string out;
  for (;;) {
    const std::size_t end = text.find('\n');
    out += files::printable(text.substr(0, end));
    if (end == std::string_view::npos) return out;
    out += '\n';
    text.remove_prefix(end + 1);
  }
}

std::string table_field(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
    out += control ? ' ' : c;
    if (c == '"') out += '"';
  }
  return out.find_first_of(",\"") == std::string::npos ? out : '"' + out + '"';
}

}  // namespace tether::scene
