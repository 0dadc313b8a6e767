// Tether: a scene while it is read. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <istream>
#include <set>

#include "fields.hpp"

namespace tether::scene::files {

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

  /// `; did you mean ...?`; nothing for problems beyond those shown: each hint looks at all names.
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
