// Tether: the SUNDIALS that runs must be the one that the plugin was compiled with.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/sundials_build.hpp>

namespace tether::ida_projection {

/// Throws std::runtime_error unless the SUNDIALS in this process has the major version of `built`
/// and no earlier minor one. (Precision and size of indices cannot be asked for at run time.)
void check_running_sundials(const SundialsBuild& built);

}  // namespace tether::ida_projection
