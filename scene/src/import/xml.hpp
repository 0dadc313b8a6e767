// Tether: XML elements with checked attributes. SPDX-License-Identifier: BSD-3-Clause
//
// Files are not trusted: size, depth, encoding, entities and character references are checked
// before anything is read from them.
#pragma once

#include <fmt/format.h>
#include <tinyxml2.h>

#include <set>

#include "robot.hpp"
#include "toml/report.hpp"

namespace tether::scene::import {

using Node = tinyxml2::XMLElement;

/// An element has no more; in MJCF they are 40. The parser compares each with all.
constexpr std::size_t kMostAttributes = 100;
/// Bytes; names stand in names and remarks made of them.
constexpr std::size_t kLongestName = 200;

/// `joint "elbow"`, or `link "arm": inertial: mass` for elements without a name.
std::string path(const Node& node);
/// The attribute `name`, or "line 12" of an element without one.
std::string name_or_line(const Node& node);
bool is(const Node& node, std::string_view name);
/// The elements inside of one: those of a name, or all.
std::vector<const Node*> elements(const Node& node, const char* name = nullptr);

/// Collects what is wrong in a file, each with its line.
class Problems : public files::Report {
 public:
  /// `folder`: files that `file` names are in it or below; empty: in that of `file`.
  explicit Problems(std::string file, std::string folder = {})
      : file_(std::move(file)), folder_(std::move(folder)) {}
  const std::string& file() const { return file_; }
  const std::string& folder() const { return folder_; }
  /// `line` 0: in a file that is included.
  void add(int line, std::string field, std::string value, const std::string& allowed) {
    Report::add({file_, std::max(line, 1), 0}, std::move(field), std::move(value),
                line > 0 ? allowed : allowed + " (in a file that it includes)");
  }
  /// Takes a name, or says that another thing of its kind has it already.
  void take(int line, const char* kind, const std::string& name, std::set<std::string>& names) {
    if (!names.insert(name).second)
      add(line, fmt::format("{} \"{}\": name", kind, name), "",
          fmt::format("another {} has it already", kind));
  }
  /// The same of an element; `inside`: what is wrong in it.
  void add(const Node& node, std::string_view inside, const std::string& allowed) {
    add(node.GetLineNum(), path(node) + (inside.empty() ? "" : ": ") + std::string(inside), "",
        allowed);
  }

 private:
  std::string file_, folder_;
};

/// A document whose text is UTF-8 with at most 64 MiB, 100 elements inside each other, no DOCTYPE
/// and no attribute twice. Throws SceneError.
class Document {
 public:
  Document(std::string_view text, Problems& problems);
  const Node& root() const { return *xml_.RootElement(); }
  /// Puts what is in the files of all <include file="..."> in their place, where it has line 0.
  /// Throws SceneError.
  void include_files(Problems& problems);

 private:
  struct Included;
  void include_files(Node& parent, int depth, Included& so_far, Problems& problems);

  tinyxml2::XMLDocument xml_;
};

/// Without what a terminal obeys in place of showing it.
std::string shown(const std::string& text);

/// Attributes by name, as in a defaults class.
using Attributes = std::map<std::string, std::string, std::less<>>;

/// The attributes of an element, those that it has not taken from `defaults`. What is wrong is
/// reported and replaced by its default.
class Tag {
 public:
  Tag(const Node& node, Problems& problems, const Attributes* defaults = nullptr)
      : node_(node), problems_(problems), defaults_(defaults) {}

  /// null: it is not there
  const char* find(std::string_view key) {
    keys_read_.emplace(key);
    if (const char* const own = node_.Attribute(std::string(key).c_str())) return own;
    if (defaults_ == nullptr) return nullptr;
    const auto found = defaults_->find(key);
    return found == defaults_->end() ? nullptr : found->second.c_str();
  }
  bool has(std::string_view key) { return find(key) != nullptr; }
  std::string text(std::string_view key, std::string_view otherwise = "") {
    const char* const found = find(key);
    return std::string(found != nullptr ? found : otherwise);
  }
  /// One of these words; another one is reported and returned.
  std::string word(std::string_view key, std::string_view otherwise,
                   std::initializer_list<std::string_view> words) {
    const std::string found = text(key, otherwise);
    if (!contains(words, found))
      wrong(key, fmt::format("must be {} or {}", fmt::join(words.begin(), words.end() - 1, ", "),
                             *(words.end() - 1)));
    return found;
  }
  std::string name(std::string_view key, std::string_view allowed);  ///< must be there
  double number(std::string_view key, double otherwise) {
    const std::vector<double> one = numbers(key, 1, 1);
    return one.empty() ? otherwise : one.front();
  }
  double positive(std::string_view key, double otherwise) {
    const double value = number(key, otherwise);
    if (value > 0) return value;
    wrong(key, "must be a number > 0");
    return otherwise;
  }
  double not_negative(std::string_view key, double otherwise) {
    const double value = number(key, otherwise);
    if (value >= 0) return value;
    wrong(key, "must be a number >= 0");
    return otherwise;
  }
  /// true or false
  bool flag(std::string_view key, bool otherwise) {
    return word(key, otherwise ? "true" : "false", {"true", "false"}) == "true";
  }
  Vector3d vector(std::string_view key, const Vector3d& otherwise) {
    const std::vector<double> v = numbers(key, 3, 3);
    return v.empty() ? otherwise : Vector3d(v[0], v[1], v[2]);
  }
  /// A direction of any length but zero; returned with length 1.
  Vector3d direction(std::string_view key, const Vector3d& otherwise) {
    const Vector3d v = vector(key, otherwise);
    if (v.stableNorm() > 0) return v.stableNormalized();
    wrong(key, "must be a direction, not zero");
    return otherwise;
  }
  /// `least` to `most` finite numbers; empty if absent or wrong.
  std::vector<double> numbers(std::string_view key, std::size_t least, std::size_t most);

  void wrong(std::string_view key, std::string allowed);
  void missing(std::string_view key, std::string allowed) {
    problems_.add(node_, key, "is missing: " + allowed);
  }
  /// Says which attributes nobody has asked for, beside those of `no_matter`.
  void finish(Remarks& remarks, const std::set<std::string, std::less<>>& no_matter = {});

  int line() const { return node_.GetLineNum(); }

 private:
  const Node& node_;
  Problems& problems_;
  const Attributes* defaults_;
  std::set<std::string, std::less<>> keys_read_;
};

/// `root`: <robot>. Problems are reported; the model is of use where there are none.
Model read_urdf(const Node& root, Problems& problems);

/// `root`: <mujoco>. Problems are reported; the model is of use where there are none.
Model read_mjcf(const Node& root, Problems& problems);

/// The surface of a file of triangles in the folder of the problems or below, times `scale`. The
/// folder of a package is that of the robot, or one of that name above it. Nothing, with a remark,
/// where it is not there or none.
std::optional<Shape> read_mesh(const Problems& robot, const std::string& name,
                               const Vector3d& scale, const std::string& of, Remarks& remarks);

}  // namespace tether::scene::import
