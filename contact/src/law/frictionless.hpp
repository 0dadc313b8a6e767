// Tether: contact without friction. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "law/interface/local_geometry.hpp"

namespace tether::contact::detail {

struct LawKernels;

struct Frictionless : OppositeSlip {
  static constexpr Law kLaw = Law::frictionless;
  static constexpr const char* kName = "frictionless";
  static constexpr bool kFriction = false;
  static const LawKernels kKernels;

  static TETHER_INLINE Regime solve(const LocalBlock& L, double bn, double, double, double* x,
                                    double&, int&) {
    x[1] = x[2] = 0;
    x[0] = bn > 0 ? bn * L.inv_a : 0;
    return bn > 0 ? Regime::sliding : Regime::separating;
  }

  static TETHER_INLINE void natural_point(const LocalBlock&, const double* x, const double* w,
                                          double* v) {
    v[0] = x[0] - w[0] > 0 ? x[0] - w[0] : 0;
    v[1] = v[2] = 0;
  }
  // mu does not count.
  static void tangent(const LocalBlock& L, const double* x, const double* w, LawTangent& out) {
    if (parting_tangent(L, x, w, out)) return;
    out.regime = Regime::sliding;
    out.P[1][1] = out.P[2][2] = 1;
  }
  static void derivative(const LocalBlock& L, double, double, double, const double*, Regime regime,
                         LocalDerivative& out) {
    for (double& d : out.d) d = 0;
    if (regime != Regime::separating) out.d[0] = L.inv_a;
  }
};

}  // namespace tether::contact::detail
