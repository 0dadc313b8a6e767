// Tether: the memory of a stepper in a saved state. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <istream>
#include <ostream>
#include <tether/contact/stepping.hpp>

namespace tether::scene::stepping {

/// With a fourth warm start, of which nothing hung; without the control of parts of steps; without
/// the joints' drift; without sleep; without what is left for cuts; as now.
enum class MemoryFormat : std::uint8_t {
  with_closings,
  without_control,
  without_drift,
  without_sleep,
  without_cuts,
  now
};

void put_memory(std::ostream& out, const contact::StepperMemory& memory);
/// Throws std::runtime_error on a memory that no stepper of so many bodies has written.
contact::StepperMemory get_memory(std::istream& in, int bodies, MemoryFormat format);

}  // namespace tether::scene::stepping
