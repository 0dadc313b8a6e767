// Tether: units of a problem, and when it counts as solved (method, eq. 15).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <tether/contact/one_contact.hpp>
#include <tether/linalg/vector_code.hpp>

namespace tether::contact::detail {

// Between these nothing that a solve multiplies leaves the range of doubles: powers of A and b up
// to the eighth (law/coulomb.hpp), a grazing b_n aside.
constexpr double kLeastOrdinary = 0x1p-30, kMostOrdinary = 0x1p30;

// The block in other units: A times 2^p, exactly.
inline LocalBlock rescaled(LocalBlock L, int p) {
  for (double* v : {&L.a, &L.c[0], &L.c[1], &L.beta[0], &L.beta[1], &L.T[0], &L.T[1], &L.T[2]})
    *v = std::ldexp(*v, p);
  L.inv_a = std::ldexp(L.inv_a, -p);
  L.ordinary = true;
  return L;
}

constexpr double kRoundOff = 0.5 * std::numeric_limits<double>::epsilon();
// Error by double sums and block solutions, in units of the error that the round-off of x alone
// causes.
constexpr double kSumUnits = 64;
// Velocities of an island of bodies that are less than this of its largest speed are round-off of
// the bodies' velocities.
constexpr double kSpeedRoundOff = 32 * kRoundOff;

// Rows contradict each other above this part of the largest speed in them, or of what their problem
// needs: above the rounding of dependent rows, below any intended motion.
constexpr double kContradiction = 1e-7;

// The change of velocity that a contact needs on its own: its approach, and of its slip what
// friction can take away, mu T/a times the approach. A slip that friction cannot stop says nothing
// about how exact impulses have to be. bt: |b_t|, ratio: (T00 + T11) / 2a.
TETHER_INLINE double needed_change(double bn, double bt, double mu, double ratio) {
  if (!(bn > 0)) return 0;
  const double reach = mu * ratio * bn;
  return bn + (bt < reach ? bt : reach);
}

// 1 / velocity scale where nothing moves: finite with a factor to spare, so that 0 times it is 0.
constexpr double kAtRest = 0x1p1000;

// 1 / velocity scale of an island, from the largest needed change and |b|^2. Where nothing
// approaches x = 0 is a solution, any other is judged by |b|. Where nothing moves only x = 0 is
// one.
inline double inverse_scale(double needed, double bb) {
  if (!(bb < std::numeric_limits<double>::infinity()))
    return std::numeric_limits<double>::quiet_NaN();  // out of range: nothing counts as solved
  const double scale = needed > 0 ? needed : std::sqrt(bb);
  return scale * kAtRest > 1 ? 1 / scale : kAtRest;
}

// Squares of velocities that are round-off beside the square of a speed.
inline double round_off(double speed) {
  return speed < std::numeric_limits<double>::infinity() ? kSpeedRoundOff * kSpeedRoundOff * speed
                                                         : 0;
}

}  // namespace tether::contact::detail
