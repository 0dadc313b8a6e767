// Tether: one number with the words of four. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <tether/linalg/vector_code.hpp>

// Texts that serve one contact and four at a time are written with these words, and are included
// once in namespace scalar and once in namespace avx2 (kernels/body_lanes_avx2.hpp), where `Real`
// is four numbers and `Mask` a choice for each. TETHER_TEXT is what a function of theirs has in
// front: it names the instruction set, which the arguments of a template cannot.

namespace tether::contact::detail::scalar {
namespace {

using Real = double;
using Mask = bool;

TETHER_INLINE Real all(double x) { return x; }
TETHER_INLINE Real root(Real x) { return std::sqrt(x); }
TETHER_INLINE Mask less(Real a, Real b) { return a < b; }
TETHER_INLINE Mask at_most(Real a, Real b) { return a <= b; }
TETHER_INLINE Mask both(Mask a, Mask b) { return a & b; }
TETHER_INLINE Real choose(Mask m, Real a, Real b) { return m ? a : b; }
TETHER_INLINE Real or_one(Mask, Real a) { return a; }               // masked lanes are not used
TETHER_INLINE Real least(Real a, Real b) { return a < b ? a : b; }  // b if one is NaN
TETHER_INLINE Real most(Real a, Real b) { return a > b ? a : b; }
TETHER_INLINE int lanes(Mask m) { return m; }

}  // namespace
}  // namespace tether::contact::detail::scalar
