// Tether: zeros of functions of time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "bounds.hpp"

namespace tether::scene::mechanics {

/// Ends of an interval in which a function changes its sign, and numbers of its signs there.
struct Bracket {
  double a, fa, b, fb;
};

/// Shortens a bracket to `resolution` by Illinois' rule.
template <class F>
Bracket narrowed(const F& f, Bracket at, double resolution) {
  constexpr int kMostIterations = 80;
  auto [a, fa, b, fb] = at;
  int side = 0;
  for (int k = 0; k < kMostIterations && std::abs(b - a) > resolution; ++k) {
    double m = (fa * b - fb * a) / (fa - fb);
    if (!(m > std::min(a, b) && m < std::max(a, b))) m = 0.5 * (a + b);
    const double fm = f(m);
    if (fm == 0) return {m, 0, m, 0};
    if ((fm > 0) == (fb > 0)) {
      b = m;
      fb = fm;
      if (side == -1) fa *= 0.5;
      side = -1;
    } else {
      a = m;
      fa = fm;
      if (side == 1) fb *= 0.5;
      side = 1;
    }
  }
  return {a, fa, b, fb};
}

/// The first time from a to b at which f is above 0; infinite: there is none. Between the ends its
/// top is looked for on the parabola through both and the middle.
template <class F>
double first_above(const F& f, double a, double b) {
  constexpr double kRounding = 4e-16;
  const double fa = f(a);
  if (fa > 0) return a;
  double end = 0.5 * (a + b), value = f(end);
  if (!(value > 0)) {
    const double fb = f(b), bend = fa - 2 * value + fb;
    const double top = 0.5 * (fa - fb) / bend;  // from the middle, in halves of the interval
    if (bend < 0 && std::abs(top) < 1) {
      const double peak = end + top * 0.5 * (b - a);
      value = f(peak);
      end = peak;
    }
    if (!(value > 0)) value = fb, end = b;
  }
  if (!(value > 0)) return kInfinity;
  return narrowed(f, {a, fa, end, value}, kRounding * std::abs(b)).b;
}

}  // namespace tether::scene::mechanics
