// Tether: rotation of one body over one step. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <random>

#include "stepping/motion/rotation.hpp"
#include "support/catch.hpp"

using namespace tether::contact::detail;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using tether::linalg::Quaternion;

TEST_CASE("rotation: the exponential has all of its digits, however small the turn") {
  for (double angle = 1e-9; angle < 4; angle *= 1.7) {
    const Vector3d axis(0.36, 0.48, 0.8);
    const Quaternion q = exponential(angle * axis);
    CHECK(std::abs(q.w() - std::cos(angle / 2)) < 4e-16);
    const long double s = std::sin(angle / 2.0L);
    for (int c = 0; c < 3; ++c)
      CHECK(q.vec()[c] == Approx(static_cast<double>(s * axis[c])).epsilon(4e-16));
  }
}

// The halves of a step are taken one after the other if Newton's method for it does not converge.
TEST_CASE("rotation: a step of many radians is its two halves") {
  const Matrix3d inertia = Vector3d(1, 2, 2.5).asDiagonal();
  const Matrix3d inverse = inertia.inverse();
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  int halved = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Vector3d start = 20 * Vector3d::NullaryExpr([&] { return normal(random); });
    Quaternion whole = Quaternion::Identity(), parts = whole;
    Vector3d w = start, v = start;
    tether::contact::StepperMemory::Spin free_whole, free_parts;
    turn_with_momentum(inertia, inverse, 1, whole, w, free_whole);
    for (int half = 0; half < 2; ++half)
      turn_with_momentum(inertia, inverse, 0.5, parts, v, free_parts);
    const bool same = (whole.coeffs() - parts.coeffs()).norm() < 1e-9;
    halved += same;
    const double energy = start.dot(inertia * start);
    const Vector3d W = whole.conjugate() * w;
    CHECK(W.dot(inertia * W) == Approx(energy).epsilon(1e-9));
  }
  CHECK(halved > 50);
}
