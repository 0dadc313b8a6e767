// Tether: which SUNDIALS the plugin and its host were compiled with.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/sundials_build.h>

namespace tether::ida_projection {

using SundialsBuild = ::tether_sundials_build;

}  // namespace tether::ida_projection
