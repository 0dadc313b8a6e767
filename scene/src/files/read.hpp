// Tether: parts of the scene reader. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/scene.hpp>

#include "toml/reader.hpp"

namespace tether::scene::files {

/// One [[body]], but for the fields of effects.
Body read_body(Fields& in, Reader& r);
/// The scene of a whole document. Throws SceneError.
Scene read(Value document, const std::string& name);
/// Checks across fields: names, pairs of materials, bodies that cannot move, times.
void check(const Scene& scene, Report& report);

}  // namespace tether::scene::files
