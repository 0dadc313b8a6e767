// Tether: indices that are int in formulas, as containers take them. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstddef>

namespace tether::linalg {

/// `index` as containers take it; it must not be negative.
constexpr std::size_t at(int index) { return static_cast<std::size_t>(index); }

}  // namespace tether::linalg
