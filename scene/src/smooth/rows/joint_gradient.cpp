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

// put(row, where its entries of this body begin within the row, body's slot, force, torque)
template <class Put>
void SparseJointGradient::each_entry(const Put& put) const {
  const Bodies& bodies = bodies_.all();
  rows_.each([&](const auto& row) {
    JointRows::each_unit_load(
        row, bodies, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
          const int place = body == row.first ? row.place_first : row.place_second;
          put(row.row + i, 6 * place, bodies.inertia[at(body)].slot, force, torque);
        });
  });
}

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

void SparseJointGradient::factor() { factor(nullptr, 1e-6); }

// A factor of the tolerance that SparseMinimumNorm calls a row dependent at.
void SparseJointGradient::factor(const std::vector<char>& wanted, double dependent) {
  factor(wanted.data(), 0.25 * dependent);
}

int SparseJointGradient::independent(std::vector<char>& rows) const {
  rows.assign(at(rows_.count()), 1);
  for (int k = factors_.rank(); k < rows_.count(); ++k) rows[at(factors_.pivot(k))] = 0;
  return factors_.rank();
}

std::vector<int> SparseJointGradient::dependent() const {
  if (factors_.dropped() == 0) return {};
  const int k = factors_.rank();
  const std::vector<double> shares = factors_.dependence(k);
  std::vector<int> rows = {factors_.pivot(k)};
  double largest = 0;
  const auto share = [&](int i) {
    return std::abs(shares[at(i)]) * factors_.row_norm(factors_.pivot(i));
  };
  for (int i = 0; i < k; ++i) largest = std::max(largest, share(i));
  for (int i = 0; i < k; ++i)
    if (share(i) > 0.1 * largest) rows.push_back(factors_.pivot(i));
  return rows;
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

void SparseJointGradient::solve(const Eigen::VectorXd& right, Eigen::VectorXd& a,
                                Eigen::VectorXd& lambda) {
  factors_.solve(right.data(), least_.data());
  factors_.multipliers(least_.data(), lambda.data());
  a.setZero();
  add_least(1.0, a);
}

void SparseJointGradient::release(Eigen::VectorXd& v) {
  multiply(v, rates_);
  factors_.solve(rates_.data(), least_.data());
  add_least(-1.0, v);
}

void SparseJointGradient::add_least(double share, Eigen::VectorXd& a) const {
  for (int k = 0; k < bodies_.count(); ++k) {
    a.segment<3>(6 * k) += share / std::sqrt(bodies_.inertia(k).mass) * least_.segment<3>(6 * k);
    a.segment<3>(6 * k + 3) += share * (roots_[at(k)] * least_.segment<3>(6 * k + 3));
  }
}

void SparseJointGradient::multiply(const Eigen::VectorXd& a, Eigen::VectorXd& rates) const {
  rates.setZero();
  each_entry([&](int row, int, int slot, const Vector3d& force, const Vector3d& torque) {
    rates[row] += force.dot(a.segment<3>(6 * slot)) + torque.dot(a.segment<3>(6 * slot + 3));
  });
}

Eigen::VectorXd SparseJointGradient::size_of_rows() const {
  Eigen::VectorXd size(rows_.count());
  for (int i = 0; i < rows_.count(); ++i) size[i] = std::pow(factors_.row_norm(i), 2);
  return size;
}

}  // namespace tether::scene::smooth
