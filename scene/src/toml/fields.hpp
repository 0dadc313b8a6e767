// Tether: the fields of one table of a scene file. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <tether/scene/words.hpp>

#include "document.hpp"
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

}  // namespace tether::scene::files
