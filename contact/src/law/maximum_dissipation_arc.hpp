// Tether: the arc on which maximum dissipation slides; a text for one and for four contacts
// (law/real.hpp), included twice and without a guard. SPDX-License-Identifier: BSD-3-Clause
//
// The equation, its bracket and the direction of its root are shared. The search for the root is
// not: one contact takes Halley's steps, four take Newton's, and the end is a division here and a
// product with the inverse there. One search for both would cost about the same, but change the
// last bits of all results. The branch around the warm start is for one contact: without it the
// compiler fuses another product, and the bits change.

// With u at angle phi from u0 = y*/|y*| and t = tan(phi/2): the derivative of the energy along the
// visible arc is the quartic sum q_i t^i, negative at `lo` and positive at `hi`, after reflection
// (side = -1: the root lies at phi < 0) and inversion (1/t: beyond 90 degrees). t: where to start.
struct Arc {
  Real u0, u1, q0, q1, q2, q3, q4, side, lo, hi, t;
  Mask inverted, wide;  // wide: the arc goes beyond 90 degrees
};

// lo, hi and t of an arc that ends at `far`, to be begun at t; the quartic is inverted where its
// root is beyond 90 degrees.
TETHER_TEXT void set_bracket(Arc& a, Real far, Real t, Mask wanted) {
  const Real zero = all(0), one = all(1);
  a.wide = less(one, far);
  a.inverted = both(a.wide, less(a.q0 + a.q1 + a.q2 + a.q3 + a.q4, zero));
  a.lo = zero;
  a.hi = least(far, one);
  if (lanes(both(a.inverted, wanted))) {
    const Real r0 = a.q0, r1 = a.q1;
    a.q0 = choose(a.inverted, -a.q4, a.q0);
    a.q1 = choose(a.inverted, -a.q3, a.q1);
    a.q2 = choose(a.inverted, -a.q2, a.q2);
    a.q3 = choose(a.inverted, -r1, a.q3);
    a.q4 = choose(a.inverted, -r0, a.q4);
    a.lo = choose(a.inverted, one / most(far, one), a.lo);
    a.hi = choose(a.inverted, one, a.hi);
    t = choose(a.inverted, choose(less(zero, t), one / most(t, all(1e-300)), one), t);
  }
  a.t = least(most(t, a.lo), a.hi);
}

// In the frame in which the tangential block is diag(beta). s = |B| y*, length = |s|, open: e >= 1,
// w: the present tangential impulse. Lanes that are not wanted hold anything.
TETHER_TEXT Arc visible_arc(Real k, Real beta0, Real beta1, Real f0, Real f1, Real h0, Real h1,
                            Real s0, Real s1, Real length, Mask open, Real w0, Real w1,
                            Mask wanted) {
  const Real zero = all(0), one = all(1), two = all(2), four = all(4);
  Arc a;
  const Real il = one / length, u0 = s0 * il, u1 = s1 * il;
  // Cosine of half the visible arc, from the conic's tangents through y*.
  const Real kappa = (k * beta0 * beta1 - f0 * s0 - f1 * s1) * il;
  // Frame (u0, R90 u0): h, g and M = k B - h g'.
  const Real p1 = u0 * h0 + u1 * h1, p2 = u0 * h1 - u1 * h0;
  const Real g1 = u0 * f0 + u1 * f1;
  Real g2 = u0 * f1 - u1 * f0;
  const Real kb0 = k * beta0, kb1 = k * beta1;
  const Real B12 = u0 * u1 * (kb1 - kb0);
  const Real M11 = kb0 * u0 * u0 + kb1 * u1 * u1 - p1 * g1, M12 = B12 - p1 * g2;
  const Real M21 = B12 - p2 * g1, M22 = kb0 * u1 * u1 + kb1 * u0 * u0 - p2 * g2;
  const Real S = p1 + M22 * g1 - M12 * g2, C = M21 * g1 - M11 * g2 - p2;
  const Real K = p1 * g2 - p2 * g1, dM = M22 - M11;
  Real q0 = M21 + C + K, q1 = two * (S + dM), q2 = two * (K - M21) - four * M12;
  Real q3 = two * (S - dM), q4 = M21 - C + K;
  const Real side = choose(less(zero, q0), -one, one);
  q0 = q0 * side;
  q2 = q2 * side;
  q4 = q4 * side;
  g2 = g2 * side;
  // Far end of the arc: T^2 = (1 - kappa) / (1 + kappa), and before the asymptote for e >= 1.
  // kappa is above 1 by rounding only.
  const Mask bounded = less(all(-1), kappa);
  Real far = root(most((one - kappa) / or_one(bounded, one + kappa), zero));
  far = choose(bounded, far, all(1e150));
  if (lanes(both(open, wanted))) {
    // (1 - g1) t^2 + 2 g2 t + (1 + g1) > 0, positive at t = 0
    const Real A = one - g1, D = g2 * g2 - A * (one + g1), r = root(most(D, zero));
    const Mask before = less(g2, zero), beyond = less(A, zero);
    const Real cut = choose(before, (one + g1) / or_one(before, r - g2),
                            choose(beyond, -(g2 + r) / or_one(beyond, A), all(-1)));
    const Mask use = both(both(open, at_most(zero, D)), both(less(zero, cut), less(cut, far)));
    far = choose(use, cut, far);
  }
  // Warm start: the direction of the present impulse.
  const Real w = root(w0 * w0 + w1 * w1), down = w + u0 * w0 + u1 * w1;
  const Mask ahead = less(all(1e-12) * w, down);
  Real t = zero;
  if (lanes(ahead)) t = choose(ahead, side * (u0 * w1 - u1 * w0) / or_one(ahead, down), zero);
  a.u0 = u0;
  a.u1 = u1;
  a.q0 = q0;
  a.q1 = q1;
  a.q2 = q2;
  a.q3 = q3;
  a.q4 = q4;
  a.side = side;
  set_bracket(a, far, t, wanted);
  return a;
}

// The direction of the impulse at the root t.
struct Direction {
  Real v0, v1;
};
TETHER_TEXT Direction direction(const Arc& a, Real t) {
  const Real one = all(1);
  Real co = one - t * t, si = all(2) * t * a.side;
  co = choose(a.inverted, -co, co);
  const Real in = one / (one + t * t);
  co = co * in;
  si = si * in;
  return {co * a.u0 - si * a.u1, co * a.u1 + si * a.u0};
}
