// Tether: a TOML document as plain values with their places. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <variant>

#include "report.hpp"

namespace tether::scene::files {

struct Entry;

/// A value of TOML. Dates and times have no use in a scene: they are `other`. Of one kind, since a
/// hundred thousand bodies are a million values.
class Value {
 public:
  enum class Kind { boolean, number, text, array, table, other };
  struct Number {
    double value;
    bool whole;  ///< was written as an integer
  };
  struct Other {};
  using Items = std::vector<Value>;
  using Entries = std::vector<Entry>;  ///< in the order of the keys' names

  Value();  ///< a table without keys

  Kind kind() const { return static_cast<Kind>(held.index()); }
  /// A value of another kind gives false, 0 or empty.
  bool boolean() const { return of<bool>(); }
  double number() const { return of<Number>().value; }
  bool whole() const { return of<Number>().whole; }
  const std::string& text() const { return of<std::string>(); }
  const Items& items() const { return of<Items>(); }
  const Entries& entries() const { return of<Entries>(); }

  std::variant<bool, Number, std::string, Items, Entries, Other> held;  ///< in the order of Kind
  int line = 0, column = 0;

 private:
  template <class T>
  const T& of() const {
    static const T none{};
    const T* own = std::get_if<T>(&held);
    return own != nullptr ? *own : none;
  }
};

struct Entry {
  std::string key;
  int line = 0, column = 0;
  Value value;
};

/// Null where the value is no table, or one without this key.
Entry* find_entry(Value& table, std::string_view key);

/// Short, in TOML, for messages.
std::string shown(const Value& value);

/// Throws SceneError where the text is not TOML.
Value parse_document(std::string_view text, const std::string& name);

}  // namespace tether::scene::files
