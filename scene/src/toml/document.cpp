// Tether: a TOML document as plain values with their places. SPDX-License-Identifier: BSD-3-Clause
//
// The only file that includes toml++: it is heavy to compile.
#include "document.hpp"
#include "bounds.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

namespace tether::scene::files {

namespace {

constexpr int kDeepest = 64;

/// Finds where tables and arrays are more than kDeepest inside each other; npos: nowhere. A dotted
/// key or header counts for all its parts, which the parser's own limit does not see though each is
/// a table that it recurses into. A text that is not TOML may get any answer: no deeper than the
/// part that the parser reads before it refuses.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  std::size_t too_deep() {
    for (; at_ < text_.size(); ++at_) {
      step(text_[at_]);
      if (header_ + inside_ + key_ + parts_ > kDeepest) return at_;
    }
    return std::string_view::npos;
  }

 private:
  void step(char c) {
    if (c == '#') at_ = std::min(text_.find('\n', at_), text_.size()) - 1;
    if (c == '"' || c == '\'') skip_string(c);
    if (c == '.') ++parts_;
    if (c == '=') begin_part(parts_);  // its value may open brackets
    if (c == ',' || (c == '\n' && open_.empty())) begin_part(0);
    if (c == '[' || c == '{') {
      if (open_.empty() && key_ == 0) is_header_ = true, header_ = 0;
      open_.push_back(key_ + 1);
      inside_ += open_.back();
      begin_part(0);
    }
    if ((c == ']' || c == '}') && !open_.empty()) {
      inside_ -= open_.back();
      open_.pop_back();
      if (open_.empty() && is_header_) header_ = parts_ + 1, is_header_ = false;
    }
  }
  void begin_part(int key) {
    key_ = key;
    parts_ = 1;
  }
  // A string is of one line, or between three quotes of any number of lines; ' knows no escapes.
  // Ends at its last quote.
  void skip_string(char quote) {
    const std::string three(3, quote);
    const bool lines = text_.substr(at_, 3) == three;
    for (at_ += lines ? 3 : 1; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (c == '\n' && !lines) return;  // no TOML
      if (c == '\\' && quote == '"') ++at_;
      if (c != quote || (lines && text_.substr(at_, 3) != three)) continue;
      // Up to two more quotes belong to the text.
      at_ = std::min(text_.find_first_not_of(quote, at_), text_.size()) - 1;
      return;
    }
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::vector<int> open_;  // of each open bracket: 1 and the parts of the key before it
  int inside_ = 0;         // the sum of these
  int header_ = 0, key_ = 0, parts_ = 1;
  bool is_header_ = false;
};

Value plain(toml::node& node, int lines_before);

// The tree of a text that cannot be cut would otherwise stand beside its copy as a whole.
void add_items(toml::array& array, int lines_before, Value::Items& out) {
  for (toml::node& item : array) {
    out.push_back(plain(item, lines_before));
    if (toml::table* table = item.as_table()) table->clear();
  }
}

Entry plain_entry(const toml::key& key, toml::node& value, int lines_before) {
  Entry out;
  out.key = std::string(key.str());
  out.line = static_cast<int>(key.source().begin.line) + lines_before;
  out.column = static_cast<int>(key.source().begin.column);
  out.value = plain(value, lines_before);
  return out;
}

// The depth of nesting is bounded before anything is parsed, so recursion is safe.
Value plain(toml::node& node, int lines_before) {
  Value out;
  out.line = static_cast<int>(node.source().begin.line) + lines_before;
  out.column = static_cast<int>(node.source().begin.column);
  if (const auto* text = node.as_string()) {
    out.held = text->get();
  } else if (const auto* whole = node.as_integer()) {
    out.held = Value::Number{static_cast<double>(whole->get()), true};
  } else if (const auto* real = node.as_floating_point()) {
    out.held = Value::Number{real->get(), false};
  } else if (const auto* flag = node.as_boolean()) {
    out.held = flag->get();
  } else if (auto* array = node.as_array()) {
    Value::Items& items = out.held.emplace<Value::Items>();
    items.reserve(array->size());
    add_items(*array, lines_before, items);
  } else if (auto* table = node.as_table()) {
    Value::Entries& entries = out.held.emplace<Value::Entries>();
    entries.reserve(table->size());
    for (auto&& [key, each] : *table) entries.push_back(plain_entry(key, each, lines_before));
  } else {
    out.held = Value::Other{};
  }
  return out;
}

// A text may be cut before a line [[key]]: what stands on either side means the same by itself as
// long as the second only adds keys, or elements to arrays of such tables. toml++ takes 1.5 kB for
// a body: of a hundred thousand some hundred stand in its tree at a time.
constexpr std::size_t kPiece = std::size_t{1} << 16;  // bytes, and up to the next such line

std::size_t end_of_piece(std::string_view text, std::size_t begin, std::size_t size) {
  constexpr std::string_view kBare =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
  std::size_t line_end = text.find("\n[[", begin + size);
  while (line_end != std::string_view::npos) {
    const std::size_t key = line_end + 3, end = text.find_first_not_of(kBare, key);
    if (end != std::string_view::npos && end > key && text.substr(end, 2) == "]]")
      return line_end + 1;
    line_end = text.find("\n[[", key);
  }
  return text.size();
}

/// Tables and values read so far of a text in pieces.
class Pieces {
 public:
  /// False where the text as a whole may mean something else, or nothing.
  bool add(toml::table& piece, int lines_before) {
    for (auto&& [key, value] : piece) {
      const bool grows = is_under_headers(value);
      const auto [at, is_new] =
          places_.try_emplace(std::string(key.str()), Known{entries_.size(), grows});
      if (is_new)
        entries_.push_back(plain_entry(key, value, lines_before));
      else if (grows && at->second.grows)
        add_items(*value.as_array(), lines_before,
                  std::get<Value::Items>(entries_[at->second.index].value.held));
      else
        return false;
    }
    return true;
  }

  Value take() {
    std::sort(entries_.begin(), entries_.end(),
              [](const Entry& a, const Entry& b) { return a.key < b.key; });
    Value out;
    out.line = out.column = 1;
    out.held = std::move(entries_);
    return out;
  }

 private:
  struct Known {
    std::size_t index;
    bool grows;
  };

  static bool is_under_headers(toml::node& value) {
    const toml::array* array = value.as_array();
    const toml::table* first =
        array != nullptr && !array->empty() ? array->front().as_table() : nullptr;
    return first != nullptr && !first->is_inline();
  }

  Value::Entries entries_;
  std::map<std::string, Known> places_;
};

/// Nothing where pieces of this size do not tell what the whole is; throws where one is no TOML.
std::optional<Value> parse_pieces(std::string_view text, const std::string& name,
                                  std::size_t size) {
  Pieces pieces;
  std::size_t begin = 0;
  int lines = 0;
  do {
    const std::string_view piece = text.substr(begin, end_of_piece(text, begin, size) - begin);
    toml::table tree = toml::parse(piece, name);
    if (!pieces.add(tree, lines)) return std::nullopt;
    lines += static_cast<int>(std::count(piece.begin(), piece.end(), '\n'));
    begin += piece.size();
  } while (begin < text.size());
  return pieces.take();
}

std::string in_quotes(std::string_view text) {
  return fmt::format("\"{}{}\"", text.substr(0, kLongestShown),
                     text.size() > kLongestShown ? "..." : "");
}

}  // namespace

std::string shown(const Value& value) {
  switch (value.kind()) {
    case Value::Kind::boolean:
      return value.boolean() ? "true" : "false";
    case Value::Kind::number:
      return fmt::format("{}", value.number());
    case Value::Kind::text:
      return in_quotes(value.text());
    case Value::Kind::array: {
      std::string out = "[";
      for (std::size_t i = 0; i < value.items().size(); ++i) {
        if (i > 0) out += ", ";
        if (i == 8 || out.size() > kLongestShown) return out + "...]";
        const Value& item = value.items()[i];
        out += item.kind() == Value::Kind::array ? "[...]" : shown(item);
      }
      return out + "]";
    }
    case Value::Kind::table:
      return value.entries().empty() ? "{}"
                                     : fmt::format("{{ {} = ... }}", value.entries().front().key);
    case Value::Kind::other:
      return "a date or time";
  }
  return "";
}

Entry* find_entry(Value& table, std::string_view key) {
  if (auto* entries = std::get_if<Value::Entries>(&table.held))
    for (Entry& each : *entries)
      if (each.key == key) return &each;
  return nullptr;
}

Value parse_document(std::string_view text, const std::string& name) {
  if (const std::size_t at = Scanner(text).too_deep(); at != std::string_view::npos) {
    const std::string_view before = text.substr(0, at);
    const auto line = 1 + std::count(before.begin(), before.end(), '\n');
    refuse({name, static_cast<int>(line), static_cast<int>(at - before.rfind('\n'))},
           fmt::format("more than {} tables and arrays inside each other; dotted keys count for "
                       "all their parts",
                       kDeepest));
  }
  try {
    if (std::optional<Value> document = parse_pieces(text, name, kPiece))
      return std::move(*document);
  } catch (const toml::parse_error&) {  // a cut inside a text or an array, or no TOML
  }
  try {
    return parse_pieces(text, name, text.size()).value();
  } catch (const toml::parse_error& e) {
    const Place place{name, static_cast<int>(e.source().begin.line),
                      static_cast<int>(e.source().begin.column)};
    refuse(place, std::string("not TOML: ") + e.what());
  }
}

}  // namespace tether::scene::files
