// Tether: the fields of one table of a scene file. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>
#include <initializer_list>
#include <istream>
#include <set>
#include <tether/scene/words.hpp>

#include "document.hpp"
#include "fields.hpp"
#include "report.hpp"

namespace tether::scene::files {

/// The allowed values of a number: finite, and between the bounds.
struct Range {
  double low, high;
  bool low_excluded;
  std::string_view words;      ///< e.g. "a number > 0"
  bool holds(double x) const;  ///< false for nan and inf
};
extern const Range kAny, kPositive, kNotNegative, kPart, kPositivePart;

/// Reads fields by name. Each wrong one is reported and replaced by its default; `finish` reports
/// the keys that no reader has used.
class Fields {
 public:
  /// `table` may be null (an absent table: everything has its default).
  Fields(const Value* table, std::string path, const std::string& file, Report& report);

  bool has(std::string_view key) { return find(key) != nullptr; }
  double number(std::string_view key, double otherwise, const Range& range, std::string_view unit);
  int count(std::string_view key, int otherwise, int low, int high);
  bool flag(std::string_view key, bool otherwise);
  std::string text(std::string_view key, const std::string& otherwise);  ///< is_plain
  std::string name(std::string_view key, const std::string& otherwise);  ///< is_name
  /// The name of an output inside its folder, with the ending of its kind; empty if absent or
  /// wrong.
  std::string output_name(std::string_view key, std::string_view ending);
  /// The name of a file to read, inside the folder of the scene; empty if absent or wrong.
  std::string input_name(std::string_view key);
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
  std::vector<std::array<double, 2>> pairs(std::string_view key, std::size_t most);
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
  const Value* table(std::string_view key);
  /// The elements of an array of tables; empty if absent.
  std::vector<const Value*> tables(std::string_view key);
  /// A value of any kind; null if absent.
  const Value* find(std::string_view key);

  /// A required field is missing.
  void missing(std::string_view key, std::string allowed);
  /// The field is there and wrong.
  void wrong(std::string_view key, std::string allowed);
  /// Keys that no reader has used.
  void finish();

  Place place() const { return place_; }
  Place place(std::string_view key);
  const std::string& path() const { return path_; }
  void rename(std::string path) { path_ = std::move(path); }
  std::string field(std::string_view key) const;

 private:
  std::string text(std::string_view key, const std::string& otherwise,
                   bool (*is_good)(std::string_view), const char* good);
  std::string inside(std::string_view key, const std::string& file, const char* whose);
  void wrong(const Entry& entry, const Value& value, std::string allowed);
  const Entry* entry(std::string_view key);

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

  /// `; did you mean ...?`; nothing for problems beyond those shown: each hint compares all names.
  template <class Names>
  std::string hint_of(const std::string& wrong, const Names& names) const {
    if (report.full()) return "";
    std::vector<std::string> all;
    for (const auto& each : names) all.push_back(name_of(each));
    return hint(wrong, all);
  }

  /// The body that `key` names.
  int body(Fields& in, std::string_view key) const;
  /// bodies = ["a", "world", ...], `least` to `most`, -1 being the world; empty where it is wrong.
  std::vector<int> several_bodies(Fields& in, std::size_t least, std::size_t most,
                                  const char* allowed) const;
  /// bodies = ["a", "world"]
  void two_bodies(Fields& in, int& first, int& second) const;

 private:
  static const std::string& name_of(const std::string& name) { return name; }
  static const std::string& name_of(const std::pair<const std::string, int>& each) {
    return each.first;
  }
  static const std::string& name_of(const Body& body) { return body.name; }
};

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

/// The field `name` of an element of [[kind]], which names it in messages from here on.
std::string read_name(Fields& in, const std::string& kind);

/// at = [[x, y, z], [x, y, z]]: on the first and on the second body; reported and left alone
/// where it is missing or wrong.
void read_two_points(Fields& in, Eigen::Vector3d& first, Eigen::Vector3d& second);

/// Names of elements of [[kind]] that stand twice, and those of which no body can move.
template <class Connection>
void check_connections(const Scene& scene, const std::vector<Connection>& all, const char* kind,
                       Report& report) {
  std::set<std::string> names;
  for (const Connection& each : all) {
    const std::string path = fmt::format("{} \"{}\"", kind, each.name);
    if (!names.insert(each.name).second)
      report.add(each.place, path + ": name", "", "another one has it already");
    if (!scene.moves(each.first) && !scene.moves(each.second))
      report.add(each.place, path + ": bodies", "", "one of them must be able to move");
  }
}

}  // namespace tether::scene::files
