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

constexpr int kMostIterations = 80;

/// Shortens a bracket to `resolution` by Illinois' rule.
template <class F>
Bracket narrowed(const F& f, Bracket at, double resolution) {
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

/// A time from a to b at which f is above 0, where it is not so at a and b; infinite: there is
/// none. Successive parabolas look for the top.
template <class F>
double above_between(const F& f, double a, double fa, double b, double fb) {
  double m = 0.5 * (a + b), fm = f(m);
  for (int k = 0; k < 8 && !(fm > 0); ++k) {
    const double to_a = (fm - fa) / (m - a), to_b = (fb - fm) / (b - m);
    if (!(to_b < to_a)) break;
    const double top = 0.5 * (a + m) - 0.5 * to_a * (b - a) / (to_b - to_a);
    if (!(top > a && top < b) || top == m) break;
    const double value = f(top);
    const bool higher = value > fm;
    if (higher == (top > m))
      a = higher ? m : top, fa = higher ? fm : value;
    else
      b = higher ? m : top, fb = higher ? fm : value;
    if (higher) m = top, fm = value;
  }
  return fm > 0 ? m : kInfinity;
}

/// The first time from a to b at which f is above 0; infinite: there is none.
template <class F>
double first_above(const F& f, double a, double b) {
  constexpr double kRounding = 4e-16;
  const double fa = f(a);
  if (fa > 0) return a;
  if (a == b) return kInfinity;
  double end = b, value = f(b);
  if (!(value > 0)) {
    end = above_between(f, a, fa, b, value);
    if (std::isinf(end)) return kInfinity;
    value = f(end);
  }
  return narrowed(f, {a, fa, end, value}, kRounding * std::abs(b)).b;
}

}  // namespace tether::scene::mechanics
