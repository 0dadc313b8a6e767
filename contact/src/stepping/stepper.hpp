// Tether: impulse-velocity steps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "stepping/accurate_steps.hpp"
#include "stepping/step_halving.hpp"
#include "stepping/sub_stepper.hpp"

namespace tether::contact {

struct Stepper::Implementation {
  Implementation(BodySet bodies, std::vector<Surface> surfaces,
                 const std::vector<Meeting>& meetings, const SteppingOptions& options);
  void step();
  void check_lengths() const;

  detail::SubStepper steps;
  detail::StepHalving halving;
  detail::AccurateSteps accurate;
  std::size_t count;  // of bodies
  double late = 0;    // how much later than its boundary the next step begins, s
};

}  // namespace tether::contact
