// Tether: a TOML document as plain values with their places. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
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

  /// a table without keys
  Value() : held(Entries()) {}

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

inline bool is_number(const Value& value) {
  return value.kind() == Value::Kind::number && std::isfinite(value.number());
}
/// An array of so many finite numbers.
inline bool is_numbers(const Value& value, std::size_t count) {
  return value.kind() == Value::Kind::array && value.items().size() == count &&
         all_of(value.items(), is_number);
}
/// f(the items of each row) of an array of `least` to `most` rows of `width` finite numbers; false:
/// it is no such array.
template <class F>
bool each_row(const Value& value, std::size_t least, std::size_t most, std::size_t width,
              const F& f) {
  const Value::Items& rows = value.items();
  if (value.kind() != Value::Kind::array || rows.size() < least || rows.size() > most) return false;
  for (const Value& row : rows) {
    if (!is_numbers(row, width)) return false;
    f(row.items());
  }
  return true;
}

/// Null where the value is no table, or one without this key.
Entry* find_entry(Value& table, std::string_view key);

/// Short, in TOML, for messages.
std::string shown(const Value& value);

/// Throws SceneError where the text is not TOML.
Value parse_document(std::string_view text, const std::string& name);

}  // namespace tether::scene::files
