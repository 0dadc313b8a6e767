// Tether: a TOML document as plain values with their places. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <tether/scene/scene.hpp>
#include <vector>

#include "report.hpp"

namespace tether::scene::files {

struct Entry;

/// A value of TOML. Dates and times have no use in a scene: they are `other`.
struct Value {
  enum class Kind { boolean, number, text, array, table, other };
  Kind kind = Kind::table;
  int line = 0, column = 0;
  bool boolean = false;
  bool whole = false;  ///< the number was written as an integer
  double number = 0;
  std::string text;
  std::vector<Value> items;    ///< array
  std::vector<Entry> entries;  ///< table, in the order of the keys' names
};

struct Entry {
  std::string key;
  int line = 0, column = 0;
  Value value;
};

/// Short, in TOML, for messages.
std::string shown(const Value& value);

/// Throws SceneError where the text is not TOML.
Value parse_document(std::string_view text, const std::string& name);

}  // namespace tether::scene::files
