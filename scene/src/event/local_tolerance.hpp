// Tether: what of a tolerance IDA gets between events (method, eq. 12). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

namespace tether::scene::event {

inline constexpr double kLeastLocal = 1e-13, kLeastInFlight = 2e-13;  // of IDA: more is rounding
inline constexpr double kTight = 1e-11;

// IDA bounds the error of a step. What it adds up to over tens of events, and tens of periods
// between them, is to be within ten tolerances (a mass that rubs to rest in thirteen turns).
inline double wanted_tolerance(double tolerance) {
  return std::min(1.0, std::pow(tolerance / 1e-4, 0.066)) * 0.025 * tolerance;
}

inline double local_tolerance(double tolerance) {
  return std::max(wanted_tolerance(tolerance), kLeastLocal);
}

// From a bounce on: an error of the height is one of the time of the next impact, over its speed.
inline double flight_tolerance(double tolerance, double speed) {
  const double wanted = wanted_tolerance(tolerance), local = local_tolerance(tolerance);
  if (wanted >= kTight) return local;
  return std::min(local, std::max(kLeastInFlight, wanted * std::min(1.0, speed)));
}

// To an impact with this speed that does not end a bounce. Errors of gaps are those of its time,
// over the speed; what the phase before has left is a part of the tolerance.
inline double graze_tolerance(double tolerance, double speed) {
  constexpr double kSlow = 0.04;
  return std::max(kLeastInFlight, wanted_tolerance(tolerance) * std::min(1.0, speed / kSlow));
}

// Tolerance of IDA after a slip begins at rest with this acceleration.
inline double turn_tolerance(double tolerance, double acceleration) {
  return std::max(kLeastInFlight, wanted_tolerance(tolerance) * std::min(1.0, acceleration));
}

}  // namespace tether::scene::event
