// Tether: a candidate, its regimes, and a root or the change of b near it.
// SPDX-License-Identifier: BSD-3-Clause

#include <Eigen/LU>
#include <cmath>
#include <optional>

#include "proof/regime_equations.hpp"

namespace tether::contact::detail {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// At least P v for P, v >= 0.
VectorXd product_above(const MatrixXd& P, const VectorXd& v) {
  VectorXd out = P * v;
  for (double& sum : out) sum = above(sum, static_cast<double>(P.cols()));
  return out;
}

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
  // J may be singular. With J + tau I a step leaves tau / (sigma + tau) of the error at a singular
  // value sigma, and moves x by rounding / tau where sigma = 0.
  const double tau = std::sqrt(kUnit);
  Candidate point{island.x, std::vector<Regime>(at(island.contacts()))}, best = point;
  std::optional<Eigen::PartialPivLU<Eigen::MatrixXd>> lu;
  double least = kInfinity, last = kInfinity;
  // Steps that do not halve the residual: regimes may still change.
  for (int idle = 0; idle < 6; ++idle) {
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

// With R near J^-1 the map e -> e - R F(x + e) = -R F(x) + (I - R J) e - R remainder takes the box
// |e| <= rho into the box of `image`. If that is smaller it has a fixed point (Brouwer), and R is
// regular, so that F(x + e) = 0. Bounds of rounded products: |fl(R J) - R J| <= gamma |R| |J|.
std::optional<Box> enclose_root(const ProofIsland& island, const Candidate& candidate) {
  const RegimeEquations equations(island, candidate.regimes, candidate.x);
  const Eigen::Index m = equations.J().rows();
  if (m == 0) return Box{equations.x(), VectorXd::Zero(candidate.x.size())};
  const Eigen::PartialPivLU<MatrixXd> lu(equations.J());
  if (!(lu.rcond() > kUnit)) return {};
  MatrixXd R = lu.inverse();
  MatrixXd G = -R * equations.J();
  G.diagonal().array() += 1;
  const VectorXd F = equations.middle(), RF = R * F;
  R = R.cwiseAbs().eval();
  G = G.cwiseAbs().eval();
  const MatrixXd J = equations.J().cwiseAbs(), A = island.A.cwiseAbs();
  const double gamma = 2 * (static_cast<double>(m) + 4) * kUnit;
  const VectorXd start =
      RF.cwiseAbs() + product_above(R, equations.radius() + gamma * F.cwiseAbs());
  VectorXd rho = 2 * start + VectorXd::Constant(m, kUnit);
  for (int k = 0; k < 10 && rho.maxCoeff() < 1; ++k) {
    const VectorXd rest = equations.remainder(rho, product_above(A, equations.scattered(rho)));
    VectorXd image = start + product_above(R, rest + gamma * product_above(J, rho)) +
                     product_above(G, rho) + gamma * rho;
    for (double& sum : image) sum = above(sum, 8);
    if ((image.array() < rho.array()).all()) return Box{equations.x(), equations.scattered(image)};
    rho = 2 * image;
  }
  return {};
}

int first_doubt(const ProofIsland& island, const std::vector<Regime>& regimes, const Box& box) {
  const int d = island.dimension;
  const Velocities in_box(island, box);
  for (int i = 0; i < island.contacts(); ++i) {
    const Interval* w = &in_box.w[at(d * i)];
    Interval x[3], power;
    for (int r = 0; r < d; ++r) x[r] = box[d * i + r];
    for (int r = 1; r < d; ++r) power = power + x[r] * w[r];
    const double mu = island.mu[i];
    bool holds = false;
    switch (regimes[at(i)]) {
      case Regime::separating:
        holds = w[0].lo >= 0;
        break;
      case Regime::sticking:
        holds = (Interval(mu) * x[0] - tangent_length(x, d)).lo >= 0;
        break;
      case Regime::sliding:  // with x_t and w_t parallel: opposite, if x_t does not vanish
        holds = mu == 0 ? x[0].lo >= 0 : x[0].lo > 0 && power.hi <= 0;
        break;
    }
    if (!holds) return i;
  }
  return -1;
}

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
