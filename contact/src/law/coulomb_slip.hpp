// Tether: Newton's method for the slip of Coulomb's law; a text for one and for four contacts
// (law/real.hpp), included twice and without a guard. SPDX-License-Identifier: BSD-3-Clause
//
// Shared are the equation and its bracket. What is done with a step is not: one contact tries
// Halley's method on P / Z first (coulomb.hpp) and goes on past the pole of p / q at e > 1, four
// leave such lanes to the whole law. Other steps would move the bits of results.

// q = |z| + g.z and p = (beta_0 + lambda)(beta_1 + lambda): lambda is where q - k p vanishes.
struct SlipEquation {
  Real excess, q, z, zh;  // q - k p, |z|, z.h
  Real slope;             // d(p/q) z q^2
};

TETHER_TEXT SlipEquation slip_equation(Real l, Real k, Real beta0, Real beta1, Real g0, Real g1,
                                       Real h0, Real h1, Real gh) {
  const Real e0 = beta0 + l, e1 = beta1 + l, p = e0 * e1;
  const Real z0 = h0 * e1, z1 = h1 * e0, z = root(z0 * z0 + z1 * z1);
  const Real q = z + g0 * z0 + g1 * z1;
  const Real zh = z0 * h0 + z1 * h1;
  return {q - k * p, q, z, zh, (e0 + e1) * q * z - p * (zh + z * gh)};
}

// s lies between (1 - e) and (1 + e) times |y|; at e > 1 it may start lower. ik = 1 / k.
struct Bracket {
  Real lo, hi;
};
TETHER_TEXT Bracket slip_bracket(Real e, Real h, Real ik, Real beta_min, Real beta_max) {
  const Real one = all(1), lo = most((one - e) * h * ik - beta_max, all(0));
  return {lo, most((one + e) * h * ik - beta_min, lo)};
}
