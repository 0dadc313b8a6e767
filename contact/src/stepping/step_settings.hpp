// Tether: what the options of steps mean for their problems. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>

namespace tether::contact::detail {

/// Errors relative to the velocity scale (method, section 3.1) at which a step stops a solve that
/// does not reach the tolerance. kEnough ends it after 3/4 of max_work. kGood ends it where more
/// work is allowed because a shorter step would not help. kUseful is the largest error that is ever
/// accepted: it is still below the error of the step, which moves bodies by their final velocities.
/// kLast is accepted in the shortest sub-steps, where anything above the tolerance is.
constexpr double kEnough = 1e-6, kGood = 1e-4, kLast = 1e-3, kUseful = 1e-2;

/// Throws std::invalid_argument.
void check(const SteppingOptions& o);
/// Options of the contact problem of a step, and of the one that reduces penetrations.
BodyOptions contact_options(const SteppingOptions& o);
/// Options of contact problems that a shorter step would not make easier.
BodyOptions patient_options(const SteppingOptions& o);
BodyOptions correction_options(const SteppingOptions& o);
/// Depth that the residual itself allows in a step: m.
double negligible_depth(const SteppingOptions& o, double dt);
/// Options of the problem that finds the gaps closed by inelastic impacts.
BodyOptions closing_options(const SteppingOptions& o);
/// Speed of a threshold in parts of sqrt(g size): m/s for a size of 1 m.
double threshold_speed(double threshold, const SteppingOptions& o);

}  // namespace tether::contact::detail
