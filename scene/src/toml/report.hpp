// Tether: what is wrong in a scene file. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <tether/scene/files.hpp>
#include <tuple>

#include "lists.hpp"

namespace tether::scene::files {

/// Collects problems, so that a user sees them in one go; the reader goes on with a default.
class Report {
 public:
  /// A file of garbage may have a problem on each of a million lines: some are kept.
  void add(const Place& place, std::string field, std::string value, std::string allowed) {
    if (full()) return;
    problems_.push_back({place, std::move(field), std::move(value), std::move(allowed)});
  }
  bool clean() const { return problems_.empty(); }
  bool full() const { return problems_.size() >= kShown; }  ///< no more are shown
  /// Throws SceneError if there is a problem.
  void finish() {
    if (clean()) return;
    std::stable_sort(problems_.begin(), problems_.end(), [](const Problem& a, const Problem& b) {
      return std::tie(a.place.line, a.place.column) < std::tie(b.place.line, b.place.column);
    });
    throw SceneError(std::move(problems_));
  }

 private:
  static constexpr std::size_t kShown = 20;

  std::vector<Problem> problems_;
};

/// Bytes of the character of UTF-8 that `text` begins with; 0: it begins with none, or with one
/// that XML does not have.
std::size_t character_at(std::string_view text);
/// `text` with a question mark for all that a terminal obeys instead of showing it: control
/// characters of ASCII and Unicode, and marks that turn the direction of what follows.
std::string printable(std::string_view text);
/// Whether a text of a scene may be one that is only shown: no comma, quote or control character,
/// no beginning that makes spreadsheets compute, and not endless.
bool is_plain(std::string_view text);
constexpr std::size_t kLongestPlain = 1000;  // bytes
constexpr const char* kPlain =
    "must hold no comma, quote or control character, not begin with = + - @, and have at most 1000 "
    "bytes";
/// Whether a text may be a name: names stand in tables and names of files, which shells, make and
/// spreadsheets may read. Full-width and small forms count as the signs that they look like.
bool is_name(std::string_view text);
constexpr const char* kName =
    "must hold no comma, quote or control character and none of ; $ ` ( ) & | < > \\ ! * ?, also "
    "in other widths, not begin with = + - @ or a blank, and have at most 1000 bytes";

/// Throws a SceneError of one problem.
[[noreturn]] inline void refuse(const Place& place, std::string why) {
  throw SceneError(std::vector<Problem>{{place, "", "", std::move(why)}});
}

/// The candidate that `text` is probably a misspelling of; empty: none is near.
std::string nearest(std::string_view text, const std::vector<std::string>& candidates);
/// a, b, c
std::string list(const std::vector<std::string>& words);
/// `; did you mean "x"?` or, where nothing is near, `; known: a, b, c`
std::string hint(std::string_view text, const std::vector<std::string>& candidates);

}  // namespace tether::scene::files
