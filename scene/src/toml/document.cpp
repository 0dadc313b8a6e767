// Tether: a TOML document as plain values with their places. SPDX-License-Identifier: BSD-3-Clause
//
// The only file that includes toml++: it is heavy to compile.
#include "document.hpp"

#include <fmt/format.h>

#include <cmath>
#include <toml++/toml.h>

#include "nesting.hpp"

namespace tether::scene::files {

namespace {

Value plain(toml::node& node);

// Of a hundred thousand bodies the document would otherwise stand beside its copy as a whole.
void add_items(toml::array& array, Value& out) {
  out.items.reserve(array.size());
  for (toml::node& item : array) {
    out.items.push_back(plain(item));
    if (toml::table* table = item.as_table()) table->clear();
  }
}

void add_entries(toml::table& table, Value& out) {
  out.entries.reserve(table.size());
  for (auto&& [key, value] : table) {
    Entry entry;
    entry.key = std::string(key.str());
    entry.line = static_cast<int>(key.source().begin.line);
    entry.column = static_cast<int>(key.source().begin.column);
    entry.value = plain(value);
    out.entries.push_back(std::move(entry));
  }
}

// The depth of nesting is bounded before anything is parsed, so recursion is safe.
Value plain(toml::node& node) {
  Value out;
  out.line = static_cast<int>(node.source().begin.line);
  out.column = static_cast<int>(node.source().begin.column);
  if (const auto* text = node.as_string()) {
    out.kind = Value::Kind::text;
    out.text = text->get();
  } else if (const auto* whole = node.as_integer()) {
    out.kind = Value::Kind::number;
    out.whole = true;
    out.number = static_cast<double>(whole->get());
  } else if (const auto* real = node.as_floating_point()) {
    out.kind = Value::Kind::number;
    out.number = real->get();
  } else if (const auto* flag = node.as_boolean()) {
    out.kind = Value::Kind::boolean;
    out.boolean = flag->get();
  } else if (auto* array = node.as_array()) {
    out.kind = Value::Kind::array;
    add_items(*array, out);
  } else if (auto* table = node.as_table()) {
    out.kind = Value::Kind::table;
    add_entries(*table, out);
  } else {
    out.kind = Value::Kind::other;
  }
  return out;
}

constexpr std::size_t kShownText = 60, kShownItems = 8;

std::string in_quotes(std::string_view text) {
  return fmt::format("\"{}{}\"", text.substr(0, kShownText), text.size() > kShownText ? "..." : "");
}

}  // namespace

std::string shown(const Value& value) {
  switch (value.kind) {
    case Value::Kind::boolean:
      return value.boolean ? "true" : "false";
    case Value::Kind::number:
      return fmt::format("{}", value.number);
    case Value::Kind::text:
      return in_quotes(value.text);
    case Value::Kind::array: {
      std::string out = "[";
      for (std::size_t i = 0; i < value.items.size(); ++i) {
        if (i > 0) out += ", ";
        if (i == kShownItems || out.size() > kShownText) return out + "...]";
        const Value& item = value.items[i];
        out += item.kind == Value::Kind::array ? "[...]" : shown(item);
      }
      return out + "]";
    }
    case Value::Kind::table:
      return value.entries.empty() ? "{}"
                                   : fmt::format("{{ {} = ... }}", value.entries.front().key);
    case Value::Kind::other:
      return "a date or time";
  }
  return "";
}

Value parse_document(std::string_view text, const std::string& name) {
  const Nesting nesting = nesting_of(text);
  if (nesting.depth > kDeepest)
    refuse(
        {name, nesting.line, nesting.column},
        fmt::format("more than {} tables and arrays inside each other; dotted keys count for all "
                    "their parts",
                    kDeepest));
  try {
    toml::table document = toml::parse(text, name);
    return plain(document);
  } catch (const toml::parse_error& e) {
    const Place place{name, static_cast<int>(e.source().begin.line),
                      static_cast<int>(e.source().begin.column)};
    refuse(place, std::string("not TOML: ") + e.what());
  }
}

}  // namespace tether::scene::files
