// Tether: one-contact blocks in other units. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <tether/contact/one_contact.hpp>

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

}  // namespace tether::contact::detail
