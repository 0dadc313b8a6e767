// Tether: places in scene files. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace tether::scene {

/// A place in a file.
struct Place {
  std::string file;          ///< its name
  int line = 0, column = 0;  ///< from 1; line 0: made by a program; column 0: not known
};

}  // namespace tether::scene
