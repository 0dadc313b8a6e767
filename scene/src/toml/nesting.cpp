// Tether: how deep a TOML text nests, before it is parsed. SPDX-License-Identifier: BSD-3-Clause
#include "nesting.hpp"

#include <vector>

namespace tether::scene::files {

namespace {

/// One pass over the characters. Depth here = parts of the table's header + parts of the keys and
/// brackets that are open.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  Nesting scan() {
    while (at_ < text_.size() && deepest_.depth <= kDeepest) step();
    return deepest_;
  }

 private:
  void step() {
    const char c = text_[at_];
    switch (c) {
      case '#':
        skip_to_line_end();
        return;
      case '"':
      case '\'':
        skip_string(c);
        return;
      case '\n':
        if (open_.empty()) end_of_line();
        break;
      case '.':
        ++parts_;
        look();
        break;
      case '=':
        in_value_ = true;
        key_ = parts_;  // its value may open brackets
        parts_ = 1;
        break;
      case ',':
        parts_ = 1;
        key_ = 0;
        break;
      case '[':
      case '{':
        bracket(c);
        break;
      case ']':
      case '}':
        close();
        break;
      default:
        break;
    }
    advance();
  }

  void bracket(char c) {
    if (c == '[' && open_.empty() && !in_value_) {  // a header
      ++in_header_;
      header_ = 0;
      parts_ = 1;
      return;
    }
    open_.push_back(key_ + 1);
    sum_ += open_.back();
    key_ = 0;
    parts_ = 1;
    look();
  }

  void close() {
    if (in_header_ > 0) {
      header_ = parts_ + 1;
      --in_header_;
    } else if (!open_.empty()) {
      sum_ -= open_.back();
      open_.pop_back();
    }
    key_ = 0;
  }

  void end_of_line() {
    in_value_ = false;
    in_header_ = 0;
    parts_ = 1;
    key_ = 0;
  }

  void look() {
    const int depth = (in_header_ > 0 ? 0 : header_) + sum_ + key_ + parts_;
    if (depth <= deepest_.depth) return;
    deepest_ = {depth, line_, static_cast<int>(at_ - line_start_) + 1};
  }

  void advance() {
    if (text_[at_] == '\n') {
      ++line_;
      line_start_ = at_ + 1;
    }
    ++at_;
  }

  void skip_to_line_end() {
    while (at_ < text_.size() && text_[at_] != '\n') ++at_;
  }

  // A string is of one line, or between three quotes of any number of lines; ' knows no escapes.
  void skip_string(char quote) {
    const bool lines = text_.substr(at_, 3) == std::string_view(quote == '"' ? "\"\"\"" : "'''");
    at_ += lines ? 3 : 1;
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '\n' && !lines) return;  // no TOML
      if (c == '\\' && quote == '"' && at_ + 1 < text_.size()) {
        advance();
      } else if (c == quote) {
        if (!lines) {
          ++at_;
          return;
        }
        std::size_t count = 0;
        while (at_ + count < text_.size() && text_[at_ + count] == quote) ++count;
        at_ += count;
        if (count >= 3) return;  // up to two more quotes belong to the text
        continue;
      }
      advance();
    }
  }

  std::string_view text_;
  std::size_t at_ = 0, line_start_ = 0;
  int line_ = 1;
  std::vector<int> open_;  // of each open bracket: 1 and the parts of the key before it
  int sum_ = 0;            // of these
  int header_ = 0, parts_ = 1, key_ = 0, in_header_ = 0;
  bool in_value_ = false;
  Nesting deepest_;
};

}  // namespace

Nesting nesting_of(std::string_view text) { return Scanner(text).scan(); }

}  // namespace tether::scene::files
