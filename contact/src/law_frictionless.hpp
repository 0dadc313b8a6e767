// Tether: contact without friction. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "local_geometry.hpp"

namespace tether::contact::detail {

struct Frictionless {
  static constexpr Law kLaw = Law::frictionless;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double, double, double* x,
                                    double&, int&) {
    x[1] = x[2] = 0;
    x[0] = bn > 0 ? bn * L.inv_a : 0;
    return bn > 0 ? Regime::sliding : Regime::separating;
  }

  static void derivative(const LocalBlock& L, double, double, double, const double*, Regime regime,
                         LocalDerivative& out) {
    for (double& d : out.d) d = 0;
    if (regime != Regime::separating) out.d[0] = L.inv_a;
  }
};

}  // namespace tether::contact::detail
