// Tether: scene files (TOML). SPDX-License-Identifier: BSD-3-Clause
//
// The format, with the unit, default and range of every field: docs/scene_fields.md.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <tether/export.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// One thing wrong in a scene file.
struct Problem {
  Place place;          ///< in the file
  std::string field;    ///< e.g. `body "a": size`
  std::string value;    ///< as written; empty: nothing was written
  std::string allowed;  ///< what would be right
  /// file:line:column: field = value: allowed
  std::string message() const;
};

/// A scene file that cannot be used: all its problems (the first twenty), in order of place.
class SceneError : public std::runtime_error {
 public:
  explicit SceneError(std::vector<Problem> problems);  ///< at least one
  /// In order of place.
  const std::vector<Problem>& problems() const { return problems_; }

 private:
  std::vector<Problem> problems_;
};

/// Reads a scene; every default is filled in. Throws SceneError and nothing else.
Scene read_scene(const std::string& path);
/// The same from text; `name` stands for the file in messages.
Scene parse_scene(std::string_view text, const std::string& name);

/// The scene as TOML with every default spelt out. Read again, it gives the same scene to the last
/// bit (Scene::file and the places apart).
std::string write_scene(const Scene& scene);

}  // namespace tether::scene
TETHER_EXPORT_END
