// Tether: a scene file with other numbers in it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <tether/export.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// A number of a scene file by its path: tables and fields with dots between. An element of an
/// array of tables is named by its `name` or its number from 1, `*` is all of them; where there is
/// only one it needs no word. Components of vectors are x, y, z, else numbers from 1:
/// "pair.friction", "body.ball.velocity.x", "spring.*.stiffness", "stepping.step". A field that is
/// not in the file is added to its table.
struct Setting {
  std::string path;  ///< of the number
  double value = 0;  ///< in its place, in the units of the file
};

/// Reads a scene with numbers put in place of those of the file; each is checked as if it stood
/// there. Throws SceneError for a scene that is wrong, std::invalid_argument for a path that leads
/// to nothing.
Scene parse_scene_with(std::string_view text, const std::string& name,
                       const std::vector<Setting>& settings);

}  // namespace tether::scene
TETHER_EXPORT_END
