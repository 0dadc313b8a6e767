// Tether: forces of rows, island by island. SPDX-License-Identifier: BSD-3-Clause
#include "row_islands.hpp"

#include <tether/linalg/disjoint_sets.hpp>

namespace tether::scene::event {

namespace {

using linalg::at;

}  // namespace

void RowIslands::choose(const MatrixXd& R, const MatrixXd& C, int block) {
  block_ = block;
  const int rows = static_cast<int>(R.rows()), bodies = static_cast<int>(R.cols()) / block;
  std::vector<int> first(at(rows), -1);
  linalg::DisjointSets sets(bodies);
  for (int i = 0; i < rows; ++i)
    for (int b = 0; b < bodies; ++b) {
      if (R.row(i).segment(block * b, block).isZero(0) &&
          C.col(i).segment(block * b, block).isZero(0))
        continue;
      if (first[at(i)] < 0) first[at(i)] = b;
      sets.join(b, first[at(i)]);
    }
  islands_.clear();
  std::vector<int> island_of(at(bodies), -1);
  for (int i = 0; i < rows; ++i) {
    if (first[at(i)] < 0) continue;  // nothing moves it, and it moves nothing
    int& k = island_of[at(sets.root(first[at(i)]))];
    if (k < 0) {
      k = static_cast<int>(islands_.size());
      islands_.push_back({{}, {}, linalg::LeastSquares(kDependentRow)});
    }
    islands_[at(k)].rows.push_back(i);
  }
  for (int b = 0; b < bodies; ++b)
    if (const int k = island_of[at(sets.root(b))]; k >= 0) islands_[at(k)].bodies.push_back(b);
}

void RowIslands::take(const Island& island, const MatrixXd& R, const MatrixXd& MC) {
  const auto m = static_cast<Eigen::Index>(island.rows.size());
  const auto n = static_cast<Eigen::Index>(island.bodies.size());
  R_.resize(m, block_ * n);
  MC_.resize(block_ * n, m);
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index b = 0; b < n; ++b) {
      const int row = island.rows[static_cast<std::size_t>(i)];
      const int from = block_ * island.bodies[static_cast<std::size_t>(b)];
      R_.row(i).segment(block_ * b, block_) = R.row(row).segment(from, block_);
      MC_.col(i).segment(block_ * b, block_) = MC.col(row).segment(from, block_);
    }
}

void RowIslands::factor(const MatrixXd& R, const MatrixXd& MC, const VectorXd& scale) {
  for (Island& each : islands_) {
    if (static_cast<Eigen::Index>(each.rows.size()) == R.rows()) {
      K_.noalias() = scale.asDiagonal() * R * MC;
    } else {
      take(each, R, MC);
      K_.noalias() = R_ * MC_;
      for (Eigen::Index i = 0; i < K_.rows(); ++i)
        K_.row(i) *= scale[each.rows[static_cast<std::size_t>(i)]];
    }
    each.factor.factor(K_);
  }
}

double RowIslands::work() const {
  double sum = 0;
  for (const Island& each : islands_) sum += std::pow(static_cast<double>(each.rows.size()), 3);
  return sum;
}

VectorXd RowIslands::solve(const VectorXd& right) const {
  if (islands_.size() == 1 && static_cast<Eigen::Index>(islands_[0].rows.size()) == right.size())
    return islands_[0].factor.solve(right);
  VectorXd out = VectorXd::Zero(right.size()), part;
  for (const Island& each : islands_) {
    part.resize(static_cast<Eigen::Index>(each.rows.size()));
    for (std::size_t i = 0; i < each.rows.size(); ++i)
      part[static_cast<Eigen::Index>(i)] = right[each.rows[i]];
    part = each.factor.solve(part);
    for (std::size_t i = 0; i < each.rows.size(); ++i)
      out[each.rows[i]] = part[static_cast<Eigen::Index>(i)];
  }
  return out;
}

}  // namespace tether::scene::event
