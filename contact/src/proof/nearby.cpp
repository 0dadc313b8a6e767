// Tether: the change of b for which a point is an exact solution. SPDX-License-Identifier:
// BSD-3-Clause
#include "proof/regime_proof.hpp"

namespace tether::contact::detail {
namespace {

// Moves a contact's impulse to a point of the cone next to it: the apex, itself where it is inside
// for sure, or (x_n, x_t mu x_n / |x_t|), a real point in the box. Returns the point's regime.
Regime move_into_cone(const ProofIsland& island, int i, Regime regime, Box& box) {
  const int d = island.dimension;
  double* x = &box.x[d * i];
  if (regime == Regime::separating || !(x[0] > 0)) {
    std::fill(x, x + d, 0.0);
    return Regime::separating;
  }
  Interval point[3];
  for (int r = 0; r < d; ++r) point[r] = x[r];
  const Interval length = tangent_length(point, d), most = Interval(island.mu[i]) * point[0];
  if (regime == Regime::sticking && length.hi <= most.lo) return regime;
  const Interval factor = island.mu[i] > 0 ? most / length : Interval(0);
  for (int r = 1; r < d; ++r) {
    const Interval t = factor * point[r];
    x[r] = t.middle();
    box.radius[d * i + r] = t.radius();
  }
  return Regime::sliding;
}

}  // namespace

NearbySolution nearby_solution(const ProofIsland& island, const Candidate& candidate) {
  const int d = island.dimension;
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(candidate.x.size());
  NearbySolution out{{candidate.x, none}, candidate.regimes, none};
  for (int i = 0; i < island.contacts(); ++i)
    out.regimes[at(i)] = move_into_cone(island, i, candidate.regimes[at(i)], out.box);
  const Velocities w(island, out.box);
  for (int i = 0; i < island.contacts(); ++i) {
    Interval change[3];  // w less the velocity that the law wants nearest to it
    for (int r = 0; r < d; ++r) change[r] = w.w[at(d * i + r)];
    const Regime regime = out.regimes[at(i)];
    if (regime == Regime::separating) change[0] = std::max(0.0, -change[0].lo);
    if (regime == Regime::separating || island.mu[i] == 0) change[1] = change[2] = 0;
    if (regime == Regime::sliding && island.mu[i] > 0) {  // -s x_t, s >= 0
      double power = 0, square = 0;
      for (int r = 1; r < d; ++r) {
        power += out.box.x[d * i + r] * change[r].middle();
        square += out.box.x[d * i + r] * out.box.x[d * i + r];
      }
      const Interval s = square > 0 ? std::max(0.0, -power / square) : 0.0;
      for (int r = 1; r < d; ++r) change[r] = change[r] + s * out.box[d * i + r];
    }
    for (int r = 0; r < d; ++r) out.change[d * i + r] = change[r].magnitude();
  }
  return out;
}

}  // namespace tether::contact::detail
