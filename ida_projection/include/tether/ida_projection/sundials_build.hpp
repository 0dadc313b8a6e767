// Tether: which SUNDIALS the plugin and its host were compiled with.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_nvector.h>
#include <tether/export.hpp>
#include <tether/ida_projection/sundials_build.h>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// A version of SUNDIALS: major, minor, patch, and bits of its indices.
using SundialsBuild = ::tether_sundials_build;

/// Throws std::runtime_error unless the SUNDIALS in this process has the major version of `built`
/// and no earlier minor one. (SUNDIALS does not tell its precision and size of indices.)
void check_running_sundials(const SundialsBuild& built);

/// Throws std::runtime_error where the code of this vector counts with indices of another size than
/// the plugin was compiled with: N_VSpace writes two of them. Vectors without it are not checked.
void check_running_indices(N_Vector vector);

}  // namespace tether::ida_projection
TETHER_EXPORT_END
