// Tether: parts of the scene reader. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/scene.hpp>

#include "fields.hpp"

namespace tether::scene::files {

/// One [[body]].
Body read_body(Fields& in, const std::string& file, Report& report);
/// wxyz, or an axis with deg or rad.
Eigen::Quaterniond read_orientation(Fields& in, const std::string& file, Report& report);
/// What no single field shows: names, pairs of materials, bodies that cannot move, times.
void check(const Scene& scene, Report& report);

}  // namespace tether::scene::files
