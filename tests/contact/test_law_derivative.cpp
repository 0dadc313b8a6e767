// Tether: derivatives of one contact's impulse against differences of its solution.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <random>
#include <tether/contact/one_contact.hpp>

#include "law/interface/local_geometry.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

Vector3d solution(Law law, const LocalBlock& block, const Vector3d& b, Regime& regime) {
  LocalState s;
  solve_local(law, block, b, s);
  regime = s.regime;
  return {s.x[0], s.x[1], s.x[2]};
}

// Central differences; false: the regime changes beside b.
bool differences(Law law, const LocalBlock& block, const Vector3d& b, Matrix3d& out) {
  constexpr double kStep = 1e-6;
  Regime here, below, above;
  solution(law, block, b, here);
  for (int k = 0; k < 3; ++k) {
    const Vector3d step = kStep * Vector3d::Unit(k);
    out.col(k) = (solution(law, block, b + step, above) - solution(law, block, b - step, below)) /
                 (2 * kStep);
    if (here != above || here != below) return false;
  }
  return true;
}

}  // namespace

// Coupling below e = 0.8, where Coulomb's law has one solution.
TEST_CASE("laws: the derivative of an impulse by b is that of differences, in each regime") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  int seen[3][2] = {};
  for (int trial = 0; trial < 6000; ++trial) {
    const Matrix3d root = Matrix3d::NullaryExpr([&] { return normal(random); });
    const Matrix3d A = root * root.transpose() + Matrix3d::Identity();
    const double mu = trial % 5 == 0 ? 0 : 0.3;
    const LocalBlock block(A, mu);
    if (block.e > 0.8) continue;
    const Vector3d b = Vector3d::NullaryExpr([&] { return normal(random); });
    for (const Law law : {Law::coulomb, Law::maximum_dissipation}) {
      Matrix3d expected;
      if (!differences(law, block, b, expected)) continue;
      Regime regime;
      const Vector3d x = solution(law, block, b, regime);
      detail::LocalDerivative out;
      detail::cone_derivative(block, b[0], b[1], b[2], x.data(), regime,
                              law == Law::maximum_dissipation, out);
      const Matrix3d found = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.d);
      CAPTURE(trial, name(law), name(regime), mu);
      REQUIRE((found - expected).norm() < 1e-6 * (1 + expected.norm()));
      ++seen[static_cast<int>(regime)][law == Law::coulomb];
    }
  }
  for (const auto& regime : seen)
    for (const int count : regime) CHECK(count > 50);
}
