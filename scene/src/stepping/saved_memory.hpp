// Tether: the memory of a stepper in a saved state. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>

#include "output/binary.hpp"

namespace tether::scene::stepping {

/// Throws std::runtime_error on a memory that no stepper of so many bodies has written.
void exchange(binary::Archive& io, int bodies, contact::StepperMemory& memory);

}  // namespace tether::scene::stepping
