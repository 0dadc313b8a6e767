// Is a text JSON (RFC 8259)? SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cctype>
#include <string>
#include <string_view>
#include <vector>

namespace tether::test {

/// Reads one value; `strings` are its strings and keys as they stand, without quotes.
class JsonCheck {
 public:
  explicit JsonCheck(std::string_view text) : rest_(text) {
    good = value() && (blanks(), rest_.empty());
  }
  bool good = false;
  std::vector<std::string> strings;

 private:
  void blanks() {
    while (!rest_.empty() && std::string_view(" \t\r\n").find(rest_[0]) != std::string_view::npos)
      rest_.remove_prefix(1);
  }
  bool take(std::string_view word) {
    blanks();
    if (rest_.substr(0, word.size()) != word) return false;
    rest_.remove_prefix(word.size());
    return true;
  }
  bool value() {
    if (take("null") || take("true") || take("false")) return true;
    if (take("{")) return take("}") || (members() && take("}"));
    if (take("[")) return take("]") || (items() && take("]"));
    return take("\"") ? text() : number();
  }
  bool items() {
    do
      if (!value()) return false;
    while (take(","));
    return true;
  }
  bool members() {
    do
      if (!take("\"") || !text() || !take(":") || !value()) return false;
    while (take(","));
    return true;
  }
  bool text() {
    std::string out;
    while (!rest_.empty() && rest_[0] != '"') {
      if (static_cast<unsigned char>(rest_[0]) < 0x20) return false;
      if (rest_[0] == '\\') {
        if (rest_.size() < 2 ||
            std::string_view("\"\\/bfnrtu").find(rest_[1]) == std::string_view::npos)
          return false;
        out += rest_[0];
        rest_.remove_prefix(1);
      }
      out += rest_[0];
      rest_.remove_prefix(1);
    }
    strings.push_back(out);
    return take("\"");
  }
  bool digits() {
    std::size_t n = 0;
    while (n < rest_.size() && std::isdigit(static_cast<unsigned char>(rest_[n])) != 0) ++n;
    rest_.remove_prefix(n);
    return n > 0;
  }
  bool number() {
    take("-");
    if (!digits()) return false;
    if (!rest_.empty() && rest_[0] == '.' && (rest_.remove_prefix(1), !digits())) return false;
    if (rest_.empty() || (rest_[0] != 'e' && rest_[0] != 'E')) return true;
    rest_.remove_prefix(1);
    if (!rest_.empty() && (rest_[0] == '+' || rest_[0] == '-')) rest_.remove_prefix(1);
    return digits();
  }

  std::string_view rest_;
};

}  // namespace tether::test
