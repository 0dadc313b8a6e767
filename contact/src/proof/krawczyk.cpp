// Tether: a root of an island's equations in a box. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>

#include "proof/regime_equations.hpp"
#include "proof/regime_proof.hpp"

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

}  // namespace

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
  constexpr int kInflations = 10;
  for (int k = 0; k < kInflations && rho.maxCoeff() < 1; ++k) {
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

}  // namespace tether::contact::detail
