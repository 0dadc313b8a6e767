// Tether: what is wrong in a scene file. SPDX-License-Identifier: BSD-3-Clause
#include "report.hpp"
#include "bounds.hpp"

#include <fmt/format.h>

#include <numeric>

namespace tether::scene {

namespace {

std::string all_messages(const std::vector<Problem>& problems) {
  std::string text;
  for (const Problem& problem : problems) text += (text.empty() ? "" : "\n") + problem.message();
  return text;
}

}  // namespace

// Keys and values are those of the file, and the message goes to a terminal.
std::string Problem::message() const {
  std::string text = place.file;
  if (place.line > 0) text += fmt::format(":{}", place.line);
  if (place.column > 0) text += fmt::format(":{}", place.column);
  text += ": ";
  if (!field.empty()) text += value.empty() ? field + ": " : fmt::format("{} = {}: ", field, value);
  return files::printable(text + allowed);
}

SceneError::SceneError(std::vector<Problem> problems)
    : std::runtime_error(all_messages(problems)), problems_(std::move(problems)) {}

namespace files {

namespace {

/// Levenshtein's distance: insertions, deletions and replacements from a to b.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, replaced});
    }
  }
  return row.back();
}

bool is_prefix(std::string_view a, std::string_view b) { return b.substr(0, a.size()) == a; }

}  // namespace

std::string nearest(std::string_view text, const std::vector<std::string>& candidates) {
  // Longer keys get no suggestion, which bounds the work.
  if (text.empty() || text.size() > kLongestShown) return "";
  std::string best;
  std::size_t least = 1 + std::max<std::size_t>(1, text.size() / 2);
  for (const std::string& candidate : candidates) {
    if (candidate.size() > kLongestShown) continue;
    const bool shortened = text.size() > 1 && is_prefix(text, candidate);  // pos, vel
    const std::size_t away = shortened ? 0 : distance(text, candidate);
    if (away < least) {
      least = away;
      best = candidate;
    }
  }
  return best;
}

std::string list(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, ", "));
}

std::string hint(std::string_view text, const std::vector<std::string>& candidates) {
  const std::string near = nearest(text, candidates);
  if (!near.empty()) return fmt::format("; did you mean \"{}\"?", near);
  if (candidates.empty() || candidates.size() > kMostSuggested) return "";
  return "; known: " + list(candidates);
}

}  // namespace files
}  // namespace tether::scene
