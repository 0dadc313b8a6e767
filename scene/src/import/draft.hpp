// Tether: parts of a robot as bodies, joints and contacts of a scene. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "import/joints.hpp"

namespace tether::scene::import {

Draft make_draft(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
                 Remarks& remarks);

}  // namespace tether::scene::import
