// Tether: the fields of one table of a scene file. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>
#include <initializer_list>
#include <istream>
#include <set>
#include <tether/scene/words.hpp>

#include "document.hpp"

namespace tether::scene::files {

/// The allowed values of a number: finite, and from `low` to `high`.
struct Range {
  double low, high;
  std::string_view words;      ///< e.g. "a number > 0"
  bool holds(double x) const;  ///< false for nan and inf
};
extern const Range kAny, kPositive, kNotNegative, kPart, kPositivePart;

/// Reads fields by name. Each wrong one is reported and replaced by its default; `finish` reports
/// the keys that no reader has used.
class Fields {
 public:
  /// `table` may be null (an absent table: everything has its default).
  Fields(const Value* table, std::string path, const std::string& file, Report& report)
      : table_(table), path_(std::move(path)), place_{file, 0, 0}, report_(report) {
    if (table_ != nullptr) place_ = {file, table_->line, table_->column};
  }

  bool has(std::string_view key) { return find(key) != nullptr; }
  double number(std::string_view key, double otherwise, const Range& range, std::string_view unit);
  int count(std::string_view key, int otherwise, int low, int high);
  bool flag(std::string_view key, bool otherwise) {
    return value(
        key, otherwise,
        [](const Value& v) {
          return v.kind() == Value::Kind::boolean ? std::optional(v.boolean()) : std::nullopt;
        },
        [] { return "must be true or false"; });
  }
  /// is_plain
  std::string text(std::string_view key, const std::string& otherwise) {
    return text(key, otherwise, is_plain, kPlain);
  }
  /// is_name
  std::string name(std::string_view key, const std::string& otherwise) {
    return text(key, otherwise, is_name, kName);
  }
  /// The name of an output inside its folder, with the ending of its kind; empty if absent or
  /// wrong.
  std::string output_name(std::string_view key, std::string_view ending);
  /// The name of a file to read, inside the folder of the scene; empty if absent or wrong.
  std::string input_name(std::string_view key) { return inside(key, text(key, ""), "scene"); }
  Eigen::Vector3d vector(std::string_view key, const Eigen::Vector3d& otherwise, const Range& range,
                         std::string_view unit);
  /// A direction of any length but zero; returned with length one.
  Eigen::Vector3d direction(std::string_view key, const Eigen::Vector3d& otherwise);
  /// An array of numbers of one of the given lengths; empty if absent or wrong.
  std::vector<double> numbers(std::string_view key, const std::vector<std::size_t>& lengths,
                              std::string_view unit);
  /// An array of vectors, `least` to `most` of them; empty if absent or wrong.
  std::vector<Eigen::Vector3d> points(std::string_view key, std::size_t least, std::size_t most);
  /// An array of 1 to `most` rows [a, b]; nothing, and nothing reported, where it is none.
  std::vector<std::array<double, 2>> pairs(std::string_view key, std::size_t most) {
    std::vector<std::array<double, 2>> out;
    const Value* value = find(key);
    if (value == nullptr || !each_row(*value, 1, most, 2, [&](const Value::Items& row) {
          out.push_back({row[0].number(), row[1].number()});
        }))
      out.clear();
    return out;
  }
  /// An angle by the unit in its key: <stem>deg or <stem>rad; in radians.
  double angle(const std::string& stem, double otherwise, std::string_view unit_end = "");
  /// One of the words of E; nothing if it is absent or wrong.
  template <class E>
  std::optional<E> word_of(std::string_view key) {
    std::vector<std::string> words;
    for (const auto& [text, value] : Words<E>::list) words.emplace_back(text);
    const int found = choice(key, words);
    if (found < 0) return std::nullopt;
    return Words<E>::list[static_cast<std::size_t>(found)].second;
  }
  /// Which of the words it is; -1 if it is absent or wrong.
  int choice(std::string_view key, const std::vector<std::string>& words);
  template <class E>
  E word(std::string_view key, E otherwise) {
    return word_of<E>(key).value_or(otherwise);
  }
  /// These keys are not reported as unknown, though no reader uses them.
  void pass_over(std::initializer_list<std::string_view> keys) {
    for (const std::string_view key : keys) find(key);
  }
  /// A table inside; null if absent or no table.
  const Value* table(std::string_view key) {
    return value<const Value*>(
        key, nullptr,
        [](const Value& v) {
          return v.kind() == Value::Kind::table ? std::optional(&v) : std::nullopt;
        },
        [&] { return fmt::format("must be a table: [{}]", key); });
  }
  /// The elements of an array of tables; empty if absent.
  std::vector<const Value*> tables(std::string_view key);
  /// A value of any kind; null if absent.
  const Value* find(std::string_view key) {
    const Entry* found = entry(key);
    return found != nullptr ? &found->value : nullptr;
  }

  /// A required field is missing.
  void missing(std::string_view key, std::string allowed) {
    entry(key);
    report_.add(place_, field(key), "", "is missing; " + std::move(allowed));
  }
  /// The field is there and wrong.
  void wrong(std::string_view key, std::string allowed) {
    if (const Entry* found = entry(key))
      wrong(*found, found->value, std::move(allowed));
    else
      missing(key, std::move(allowed));
  }
  /// Keys that no reader has used.
  void finish() {
    if (table_ == nullptr) return;
    for (const Entry& each : table_->entries()) {
      if (contains(known_, each.key)) continue;
      report_.add({place_.file, each.line, each.column}, field(each.key), shown(each.value),
                  "unknown key" + (report_.full() ? "" : hint(each.key, known_)));
    }
  }

  Place place() const { return place_; }
  Place place(std::string_view key) {
    const Entry* found = entry(key);
    return found != nullptr ? Place{place_.file, found->line, found->column} : place_;
  }
  const std::string& path() const { return path_; }
  void rename(std::string path) { path_ = std::move(path); }
  std::string field(std::string_view key) const {
    if (path_.empty()) return std::string(key);
    return fmt::format("{}: {}", path_, key);
  }

 private:
  /// get(the value): what it is, nothing where it is not right; allowed(): what would be.
  template <class T, class Get, class Allowed>
  T value(std::string_view key, T otherwise, const Get& get, const Allowed& allowed) {
    const Entry* found = entry(key);
    if (found == nullptr) return otherwise;
    if (std::optional<T> right = get(found->value)) return *std::move(right);
    wrong(*found, found->value, allowed());
    return otherwise;
  }
  std::string text(std::string_view key, const std::string& otherwise,
                   bool (*is_good)(std::string_view), const char* good);
  std::string inside(std::string_view key, const std::string& file, const char* whose);
  void wrong(const Entry& entry, const Value& value, std::string allowed);
  const Entry* entry(std::string_view key) {
    if (!contains(known_, key)) known_.emplace_back(key);
    if (table_ == nullptr) return nullptr;
    for (const Entry& each : table_->entries())
      if (each.key == key) return &each;
    return nullptr;
  }

  const Value* table_;
  std::string path_;
  Place place_;
  Report& report_;
  std::vector<std::string> known_;  // the keys asked for so far
};

/// The scene under construction and the data shared by all parts of the reader.
struct Reader {
  const std::string& file;
  Report& report;
  Scene scene;
  std::map<std::string, int> bodies;  ///< by name
  std::set<std::string> materials;    ///< of bodies
  std::set<std::string> surface_files;
  std::size_t surface_bytes = 0;      ///< read from them so far
  std::size_t surface_triangles = 0;  ///< of all bodies so far
  contact::Shape last_mesh = {};      ///< of a body that moves, with its convex parts: bodies that
  std::vector<contact::Shape> last_parts = {};  ///< are repeated are split once

  Fields fields(const Value* table, std::string path) const {
    return {table, std::move(path), file, report};
  }

  /// Reads the elements of [[key]]; `path` of one without a name: key and number.
  template <class Read>
  void each(Fields& root, std::string_view key, Read read) {
    int number = 0;
    for (const Value* table : root.tables(key)) {
      Fields in = fields(table, fmt::format("{} {}", key, ++number));
      read(in);
      in.finish();
    }
  }

  /// The element of [[kind]] that `key` names, by its number in `all`; 0 where it is wrong.
  int named(Fields& in, std::string_view key, const std::string& kind,
            const std::map<std::string, int>& all) const {
    if (!in.has(key)) return in.missing(key, "the name of a " + kind), 0;
    const std::string name = in.name(key, "");
    if (const auto found = all.find(name); found != all.end()) return found->second;
    in.wrong(key, "no such " + kind + hint_of(name, all));
    return 0;
  }
  /// An array of `least` to `most` names of `known` ones, or of `besides`; empty where it is wrong:
  /// `unknown` says what a name is that is not known.
  template <class Known>
  std::vector<std::string> names(Fields& in, std::string_view key, std::size_t least,
                                 std::size_t most, const char* allowed, const char* unknown,
                                 const Known& known, std::string_view besides = {}) const {
    const Value* value = in.find(key);
    std::vector<std::string> out;
    if (value == nullptr) return in.missing(key, allowed), out;
    bool right = value->kind() == Value::Kind::array && value->items().size() >= least &&
                 value->items().size() <= most;
    for (std::size_t k = 0; right && k < value->items().size(); ++k) {
      const std::string& name = out.emplace_back(value->items()[k].text());
      right = value->items()[k].kind() == Value::Kind::text;
      if (!right || name == besides || known.count(name) > 0) continue;
      in.wrong(key, fmt::format("{} \"{}\"{}", unknown, name, hint_of(name, known)));
      return {};
    }
    if (right) return out;
    in.wrong(key, std::string("must be ") + allowed);
    return {};
  }
  /// bodies = ["a", "world", ...], `least` to `most`, -1 being the world; empty where it is wrong.
  std::vector<int> several_bodies(Fields& in, std::size_t least, std::size_t most,
                                  const char* allowed) const {
    std::vector<int> out;
    for (const std::string& name :
         names(in, "bodies", least, most, allowed, "there is no body", bodies, "world"))
      out.push_back(name == "world" ? -1 : bodies.at(name));
    return out;
  }

 private:
  /// `; did you mean ...?`; nothing for problems beyond those shown: each hint compares all names.
  template <class Known>
  std::string hint_of(const std::string& wrong, const Known& known) const {
    if (report.full()) return "";
    std::vector<std::string> all;
    for (const auto& each : known) all.push_back(name_of(each));
    return hint(wrong, all);
  }
  static const std::string& name_of(const std::string& name) { return name; }
  static const std::string& name_of(const std::pair<const std::string, int>& each) {
    return each.first;
  }
};

/// By name; the first of several.
template <class Named>
std::map<std::string, int> index_of(const std::vector<Named>& all) {
  std::map<std::string, int> out;
  for (const Named& each : all) out.emplace(each.name, static_cast<int>(&each - all.data()));
  return out;
}

/// All that is left of it, a block more than `most` bytes at most. By blocks: reading a folder, or
/// a file that is truncated meanwhile, fails without a throw.
inline std::string read_stream(std::istream& in, std::size_t most) {
  std::string text;
  std::vector<char> block(std::size_t{1} << 16);
  while (in && text.size() <= most) {
    in.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block.data(), static_cast<std::size_t>(in.gcount()));
  }
  return text;
}

/// The pieces of a text between these characters.
inline std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> out(1);
  for (const char c : text)
    if (c == at)
      out.emplace_back();
    else
      out.back() += c;
  return out;
}

/// Reports a name of [[kind]] that `names` has; else it has it from here on.
template <class Named>
void check_name(const Named& each, const char* kind, std::set<std::string>& names, Report& report) {
  if (!names.insert(each.name).second)
    report.add(each.place, fmt::format("{} \"{}\": name", kind, each.name), "",
               "another one has it already");
}

/// Names of elements of [[kind]] that stand twice, and those of which no body can move.
template <class Connection>
void check_connections(const Scene& scene, const std::vector<Connection>& all, const char* kind,
                       Report& report) {
  std::set<std::string> names;
  for (const Connection& each : all) {
    check_name(each, kind, names, report);
    if (!scene.moves(each.first) && !scene.moves(each.second))
      report.add(each.place, fmt::format("{} \"{}\": bodies", kind, each.name), "",
                 "one of them must be able to move");
  }
}

}  // namespace tether::scene::files
