// Tether: places in scene files. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace tether::scene {

/// Line and column in a file; line 0: made by a program; column 0: not known.
struct Place {
  std::string file;
  int line = 0, column = 0;
};

}  // namespace tether::scene
