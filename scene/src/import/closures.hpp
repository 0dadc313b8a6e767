// Tether: closures of loops as joints of a scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "parts.hpp"

namespace tether::scene::import {

/// Adds a ball or fixed joint for each closure of the model, at the start. `body_of`: of each part,
/// -1: the world.
void add_closures(const Model& model, const std::vector<Part>& parts,
                  const std::vector<int>& body_of, Draft& draft, Remarks& remarks);

}  // namespace tether::scene::import
