// Tether: what the options of steps mean for their problems. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>

namespace tether::contact::detail {

/// Parts of the largest velocity that a contact needs. Where the tolerance is not met a better
/// answer than `kEnough` is worth no more than 3/4 of max_work, and than `kGood` none of what
/// is added to max_work where a shorter step would not help. Answers within `kUseful` are as good
/// as the step: it moves bodies by velocities of its end, an error of half of what it changes them
/// by, while one contact is off by so much in a problem that is not solved. Where anything is
/// accepted the shortest parts, which nothing makes easier any more, are used within `kLast`.
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
