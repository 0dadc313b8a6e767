// Tether: the text of a scene, from a file or the standard input. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/vary.hpp>
#include <vector>

namespace tether::scene {

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
