// Tether: which SUNDIALS the plugin and its host were compiled with.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/ida_projection/sundials_build.h>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

using SundialsBuild = ::tether_sundials_build;

/// Throws std::runtime_error unless the SUNDIALS in this process has the major version of `built`
/// and no earlier minor one. (Precision and size of indices cannot be asked for at run time.)
void check_running_sundials(const SundialsBuild& built);

}  // namespace tether::ida_projection
TETHER_EXPORT_END
