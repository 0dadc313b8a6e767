// Tether: walls of bricks, with many more contacts than velocities. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "packing.hpp"

namespace tether::contact::random {

// Bricks at rest, those of every other row half a brick to the right. Each touches its neighbours
// with the corners of the face that they share, and the lowest row the ground.
class BrickWall {
 public:
  BrickWall(int rows, int columns, double mu) : columns_(columns), mu_(mu) {
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) add_brick(r, c);
    for (int i = 0; i < rows * columns; ++i) touch_neighbours(i);
  }
  const Packing& packing() const { return packing_; }

 private:
  static constexpr double kLong = 0.4, kShort = 0.2, kMass = 32;  // m, m, kg

  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  double left(int i) const { return centre_[index(i)].x() - 0.5 * kLong; }

  void add_brick(int row, int column) {
    RigidBody b;
    const double small = kShort * kShort, large = kLong * kLong;
    b.inverse_mass = 1 / kMass;
    b.inverse_inertia.diagonal() << 6 / (kMass * small), 12 / (kMass * (large + small)),
        12 / (kMass * (large + small));
    centre_.emplace_back(kLong * (column + 0.5 * (row % 2)), 0, kShort * (row + 0.5));
    packing_.bodies.push_back(b);
  }
  void touch_neighbours(int i) {
    const double foot = centre_[index(i)].z() - 0.5 * kShort;
    if (i < columns_) lies_on(i, -1, left(i), left(i) + kLong, foot);
    if (i % columns_ > 0)
      for (double y : {-0.5, 0.5})
        for (double z : {0.0, 1.0})
          touch(i, i - 1, {left(i), y * kShort, foot + z * kShort}, Eigen::Vector3d::UnitX());
    const int row = i - i % columns_;
    for (int j = row - columns_; j >= 0 && j < row; ++j) {
      const double from = std::max(left(i), left(j)), to = std::min(left(i), left(j)) + kLong;
      if (to - from > 1e-9) lies_on(i, j, from, to, foot);
    }
  }
  void lies_on(int i, int j, double from, double to, double height) {
    for (double x : {from, to})
      for (double y : {-0.5, 0.5}) touch(i, j, {x, y * kShort, height}, Eigen::Vector3d::UnitZ());
  }
  void touch(int i, int j, const Eigen::Vector3d& p, const Eigen::Vector3d& normal) {
    PointContact c;
    c.first = i;
    c.second = j;
    c.r1 = p - centre_[index(i)];
    c.r2 = j < 0 ? p : Eigen::Vector3d(p - centre_[index(j)]);
    c.normal = normal;
    c.mu = mu_;
    packing_.contacts.push_back(c);
  }

  int columns_;
  double mu_;
  std::vector<Eigen::Vector3d> centre_;
  Packing packing_;
};

}  // namespace tether::contact::random
