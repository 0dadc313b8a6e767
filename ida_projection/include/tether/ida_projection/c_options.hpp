// Tether: the options of programs in C, for C++. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/ida_projection.h>
#include <tether/ida_projection/options.hpp>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// null: the defaults. `unknowns`: the length of `hold` and `group`, read only where these are
/// given. Throws std::invalid_argument, naming the field and its value.
Options options_of(const tether_options* options, long unknowns);

}  // namespace tether::ida_projection
TETHER_EXPORT_END
