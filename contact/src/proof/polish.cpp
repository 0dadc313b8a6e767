// Tether: impulses brought to rounding, and their regimes. SPDX-License-Identifier: BSD-3-Clause
#include "proof/polish.hpp"

#include <Eigen/LU>
#include <cmath>
#include <optional>

#include "proof/regime_equations.hpp"

namespace tether::contact::detail {
namespace {

using Eigen::VectorXd;

// The regime of the projection of x - w on the cone (Alart and Curnier, CMAME 92 (1991) 353). A
// contact whose regime changes moves to that projection.
bool update_regime(const ProofIsland& island, int i, const Velocities& at_x, bool first,
                   Candidate& point) {
  const int d = island.dimension;
  const double mu = island.mu[i];
  double y[3] = {0, 0, 0};
  for (int r = 0; r < d; ++r) y[r] = point.x[d * i + r] - at_x.w[at(d * i + r)].middle();
  const double tangent = std::hypot(y[1], y[2]);
  Regime regime = Regime::separating;
  if (y[0] > 0) regime = tangent < mu * y[0] ? Regime::sticking : Regime::sliding;
  if (!first && regime == point.regimes[at(i)]) return false;
  point.regimes[at(i)] = regime;
  const double normal = regime == Regime::separating ? 0 : 1;
  const double factor = regime == Regime::sliding && tangent > 0 ? mu * y[0] / tangent : normal;
  for (int r = 0; r < d; ++r) point.x[d * i + r] = (r == 0 ? normal : factor) * y[r];
  return true;
}

}  // namespace

Candidate polish(const ProofIsland& island) {
  constexpr int kPatience = 6;  // steps that do not halve the residual: regimes may still change
  // J may be singular. With J + tau I a step leaves tau / (sigma + tau) of the error at a singular
  // value sigma, and moves x by rounding / tau where sigma = 0.
  const double tau = std::sqrt(kUnit);
  Candidate point{island.x, std::vector<Regime>(at(island.contacts()))}, best = point;
  std::optional<Eigen::PartialPivLU<Eigen::MatrixXd>> lu;
  double least = kInfinity, last = kInfinity;
  for (int idle = 0; idle < kPatience; ++idle) {
    const Velocities at_x(island, {point.x, VectorXd::Zero(point.x.size())});
    bool changed = false;
    for (int i = 0; i < island.contacts(); ++i)
      if (update_regime(island, i, at_x, !lu, point)) changed = true;
    const RegimeEquations equations(island, point.regimes, point.x);
    const VectorXd F = equations.middle();
    const double size = F.size() > 0 ? F.lpNorm<Eigen::Infinity>() : 0;
    if (size < least / 2) idle = 0;
    if (size < least) {
      least = size;
      best = point;
    }
    if (F.size() == 0 || size <= 2 * kUnit * at_x.size) break;
    if (changed || size > last / 8) {
      Eigen::MatrixXd J = equations.J();
      J.diagonal().array() += tau;
      lu.emplace(J);
    }
    last = size;
    const VectorXd step = lu->solve(F);
    if (!step.allFinite()) break;
    point.x -= equations.scattered(step);
  }
  return best;
}

}  // namespace tether::contact::detail
