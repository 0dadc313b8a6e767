// Tether: directions turned into each other. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <random>
#include <tether/linalg/pi.hpp>
#include <tether/linalg/shortest_turn.hpp>

#include "support/catch.hpp"

using Eigen::Quaterniond;
using Eigen::Vector3d;
using tether::linalg::kPi;
using tether::linalg::shortest_turn;

TEST_CASE("the shortest turn takes one direction to another, nearly opposite ones, too") {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    return Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  for (int k = 0; k < 1000; ++k) {
    const Vector3d from = direction(), across = from.cross(direction()).normalized();
    // From the same direction to the opposite one, and to within 1e-15 .. 1 of both.
    const double little = k % 50 < 2 ? 0 : std::pow(10, -15 * ((k / 2 % 50) / 50.0));
    const double angle = k % 2 == 0 ? little : kPi - little;
    const Vector3d to = std::cos(angle) * from + std::sin(angle) * across;
    const Quaterniond turn = shortest_turn(1e-3 * from, 40 * to);
    CAPTURE(k, angle);
    CHECK(std::abs(turn.norm() - 1) < 1e-15);
    CHECK((turn * from - to).norm() < 2e-15);
    // No shorter turn does that (a cosine tells half of the digits at angle pi).
    CHECK(std::abs(turn.angularDistance(Quaterniond::Identity()) - angle) < 1e-7);
  }
}

TEST_CASE("opposite directions are turned about the axis that files of robots mean") {
  const Quaterniond turn = shortest_turn(Vector3d::UnitZ(), -2 * Vector3d::UnitZ());
  CHECK((turn.toRotationMatrix() - Vector3d(1, -1, -1).asDiagonal().toDenseMatrix()).norm() <
        1e-15);
}
