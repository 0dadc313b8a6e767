// Tether: bodies in contact whose contact point is an algebraic unknown.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>
#include <string>
#include <vector>

namespace tether::test {

/// A convex body that touches a smooth surface. Unknowns (q, v, s, lam): s are the parameters of
/// the contact point, determined by tangency equations T(q, s) = 0 of F; lam the contact forces.
///
///   q' = K(q) v,  M v' = f(q, v) + W(q, s)^T lam,  T(q, s) = 0,
///
/// where W v is the velocity at the contact, its first entry the rate of the gap. Closed by
///
/// - "index 1": d(W v)/dt = 0 with v' as it stands, s' from T' = 0;
/// - "index 1 a": the same with v' replaced by M^-1 (f + W^T lam): an equation without derivatives;
/// - "index 2": W v = 0;
/// - "GGL": W v = 0, gap = 0, and q' = K (v + W_1^T mu);
/// - "explicit": unknowns (q, v) alone, s by Newton's method and lam by elimination in F.
///
/// The derivative of the gap to s vanishes where T = 0, that of W v does not. Rows: "gap" (the
/// quaternion's norm with it), "rate" (W v), "energy", "tangency" (T). Jacobians are exact.
/// The names are those of the surfaces below.
std::vector<std::string> contact_forms();

/// An ellipse (half axes 0.5, 0.3; mass 1) on the rail y = amplitude cos(2 x), gravity 9.81,
/// rolling without slip or sliding without friction. s: angle on the ellipse, x on the rail.
/// `scale` multiplies every length, times grow by its root.
problems::Problem wheel_on_rail(const std::string& form, bool rolling, double t_end,
                                double amplitude = 0.1, double scale = 1.0);

/// An ellipsoid (half axes 0.5, 0.4, 0.3; mass 1, uniform) on the plane z = 0, gravity 9.81;
/// attitude as quaternion, angular velocity in the body. s: the contact point in the body, which
/// solves s = -A^2 n / |A n|, n the plane's normal seen from the body.
problems::Problem ellipsoid_on_plane(const std::string& form, bool rolling, double t_end);

/// The same for a superquadric of exponent 4, made regular where its curvature would vanish:
/// x^4 + y^4 + z^4 + (x^2 + y^2 + z^2) / 2 = 3/2 in units of the half axes; the inertia is that of
/// the ellipsoid. The contact point and a multiplier of the normal solve its equations.
problems::Problem superquadric_on_plane(const std::string& form, bool rolling, double t_end);

}  // namespace tether::test
