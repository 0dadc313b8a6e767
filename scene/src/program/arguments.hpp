// Tether: numbers of the command line. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/vary.hpp>

namespace tether::scene {

/// A finite number; nothing else has a value.
std::optional<double> finite_number(const std::string& text);
/// Refuses all but finite numbers > 0.
CLI::Validator positive_number();

/// Each item is a number > 0 or a range "1e-3:1e-9", which gives both ends and what lies between
/// them by factors of `ratio`. std::invalid_argument naming `option` and the item otherwise.
std::vector<double> read_settings(const std::string& option, const std::vector<std::string>& items,
                                  double ratio);

struct SceneText {
  std::string text, name;
};

/// The text of any file of at most 256 MiB; "-" is the standard input. std::invalid_argument where
/// it cannot be read.
SceneText read_text(const std::string& file);

/// "-" is the standard input. Throws SceneError where there is nothing to read.
SceneText read_scene_text(const std::string& file);

/// The scene of a file or, of "-", of the standard input.
Scene read_scene_argument(const std::string& file);

/// Throws std::invalid_argument if a path leads to nothing. Values that are wrong are no matter.
void parse_paths(const SceneText& scene, const std::vector<Setting>& settings);

/// PATH=FROM:TO:COUNT[:log] or PATH=VALUE,VALUE,...
struct VariedNumber {
  std::string path;
  std::vector<double> values;
};

/// std::invalid_argument naming the word otherwise.
VariedNumber read_varied(const std::string& word);

}  // namespace tether::scene
