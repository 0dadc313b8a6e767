// Tether: the memory of a stepper in a saved state. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <istream>
#include <ostream>
#include <tether/contact/stepping.hpp>

namespace tether::scene::stepping {

void put_memory(std::ostream& out, const contact::StepperMemory& memory);
/// Throws std::runtime_error on a memory that no stepper of so many bodies has written.
contact::StepperMemory get_memory(std::istream& in, int bodies);

}  // namespace tether::scene::stepping
