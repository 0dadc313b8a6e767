// Tether: residuals of any answer to a contact problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <tether/contact/problem.hpp>
#include <tether/export.hpp>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// All in the units of a velocity (impulses are multiplied by A_nn) unless said; NaN: not computed.
struct Residuals {
  /// A residual that was not computed.
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double signorini = kNone;      ///< max |min(A_nn x_n, w_n)|
  double cone = kNone;           ///< max A_nn (|x_t| - mu x_n)+
  double alignment = kNone;      ///< max over contacts of |w_t - target|: target 0 inside the cone,
                                 ///< on it the nearest -s (u + gamma), s >= 0, gamma of the law
  double dissipation = kNone;    ///< sum of x_i . w_i (energy): <= 0 at a solution
  double energy_change = kNone;  ///< 1/2 x'Ax - b'x: kinetic energy gained by the impulses
  /// Largest error in velocity of a contact, over the largest velocity that a contact of its island
  /// needs (method, section 3); at least what round-off makes of A x - b. Changed by no units.
  double fixed_point = kNone;
  double natural_map = kNone;  ///< |x - P_K(x - w - De Saxce term)| / max(|b|, |x|, |w|)
};

/// The same yardstick for every solver. natural_map is the law's own (method, eq. 21); for
/// Law::coulomb it is the one that Siconos reports. `impulses` has dimension * contacts entries;
/// if one of them is not finite, all is NaN.
Residuals evaluate(const Problem& problem, Law law, const linalg::VectorView& impulses);

}  // namespace tether::contact
TETHER_EXPORT_END
