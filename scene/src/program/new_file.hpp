// Tether: files that are not there yet. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace tether::scene {

/// Makes the file; nobody else's in between. std::invalid_argument where it is there already.
void reserve(const std::string& file);

}  // namespace tether::scene
