// Tether: the gradient of many joints and its factors. SPDX-License-Identifier: BSD-3-Clause
#include "rows_in_use.hpp"

#include <Eigen/Cholesky>

namespace tether::scene::smooth {

namespace {

using Row6 = Eigen::Matrix<double, 1, 6>;

// Rows whose independent part is smaller are dependent. In nets of balls coefficients of dependent
// rows reach 1e4. A dependent row that is kept carries a multiplier that nothing determines, and
// steps collapse.
constexpr double kThin = 1e-4;

}  // namespace

SparseJointGradient::SparseJointGradient(const JointRows& rows, const MovingBodies& bodies)
    : rows_(rows), bodies_(bodies) {
  for (int k = 0; k < bodies.count(); ++k)
    roots_.emplace_back(bodies.inertia(k).inverse.llt().matrixL());
  std::vector<std::vector<int>> slots(at(rows.count()));
  each_entry([&](int row, int, int slot, const Vector3d&, const Vector3d&) {
    slots[at(row)].push_back(slot);
  });
  std::vector<int> columns;
  starts_.push_back(0);
  for (std::vector<int>& of_row : slots) {
    sort_unique(of_row);
    for (const int slot : of_row)
      for (int j = 0; j < 6; ++j) columns.push_back(6 * slot + j);
    starts_.push_back(static_cast<int>(columns.size()));
  }
  factors_.resize(6 * bodies.count(), starts_, std::move(columns), 0);
  std::fill_n(factors_.metric(), 6 * bodies.count(), 1.0);
  least_.setZero(6 * bodies.count());
  rates_.setZero(rows.count());
}

void SparseJointGradient::factor(const char* wanted, double rank_tolerance) {
  std::fill_n(factors_.entries(), starts_.back(), 0.0);
  each_entry([&](int row, int offset, int slot, const Vector3d& force, const Vector3d& torque) {
    if (wanted && !wanted[row]) return;
    Eigen::Map<Row6> to(factors_.entries() + starts_[at(row)] + offset);
    to.head<3>() += force.transpose() / std::sqrt(bodies_.inertia(slot).mass);
    to.tail<3>() += torque.transpose() * roots_[at(slot)];
  });
  factors_.factor(rank_tolerance, kThin);
}

}  // namespace tether::scene::smooth
