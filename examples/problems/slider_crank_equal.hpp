// Tether: slider crank with crank and coupler of equal length. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// "index 1", "index 1 w", "index 2"; see mechanism.hpp.
std::vector<std::string> slider_crank_equal_forms();

/// Start angle (rad), angular speed (rad/s), gravity (m/s^2) of the motion.
struct SliderCrankMotion {
  double angle, speed, gravity;
};
/// Turns through the singular positions without gravity, E = 11/6.
constexpr SliderCrankMotion kSliderCrankSlow{0.78539816339744830962, 1.0, 0.0};
/// The same four times as fast, E = 88/3.
constexpr SliderCrankMotion kSliderCrankFast{0.78539816339744830962, 4.0, 0.0};
/// From rest; swings through the lower singular position and back.
constexpr SliderCrankMotion kSliderCrankSwing{0.78539816339744830962, 0.0, 9.81};
/// Turns against gravity, E = 12.
constexpr SliderCrankMotion kSliderCrankTurn{0.0, 6.0, 9.81};

/// Crank and coupler: uniform rods of length 1 and mass 1; slider of mass 1 on the x axis.
/// Unknowns: th1, th2 (from the x axis), slider position x. The motion follows th2 = -th1; at th1 =
/// +-pi/2 the position rows lose rank (2 -> 1) and the branch th2 = th1 + pi, on which the slider
/// stands still, opens. The multipliers are not determined there.
///
/// Rows: "position", "velocity", "acceleration" (2 each), "energy". Reference at any t_end from the
/// equation of motion in th1 alone.
Problem slider_crank_equal(const SliderCrankMotion& motion, double t_end, const std::string& form);

}  // namespace tether::problems
