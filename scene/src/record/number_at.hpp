// Tether: numbers in tables and films that go on. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <limits>
#include <string>

namespace tether::scene {

/// The number that begins at a place of a line, the same in every locale; NaN: there is none.
inline double number_at(const std::string& line, std::size_t place) {
  double value = std::numeric_limits<double>::quiet_NaN();
  if (place < line.size()) std::from_chars(line.data() + place, line.data() + line.size(), value);
  return value;
}

}  // namespace tether::scene
