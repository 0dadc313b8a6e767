// Tether: the root of an inverse mass. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>

namespace tether::contact::detail {

/// C with C C' = inverse mass.
Matrix6d inverse_mass_root(const Matrix6d& inverse_mass);

}  // namespace tether::contact::detail
