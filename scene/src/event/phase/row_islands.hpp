// Tether: forces of rows, island by island. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/least_squares.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

/// K = S R M^-1 C S of rows R and columns C, S a diagonal. Rows of bodies that no row connects do
/// not meet in it: each such island has factors of its own.
class RowIslands {
 public:
  /// By what rows and columns are not zero in; bodies have six velocities each.
  void choose(const MatrixXd& R, const MatrixXd& C) {
    const int rows = static_cast<int>(R.rows()), bodies = static_cast<int>(R.cols()) / 6;
    std::vector<int> first(at(rows), -1);
    linalg::DisjointSets sets(bodies);
    for (int i = 0; i < rows; ++i)
      for (int b = 0; b < bodies; ++b) {
        if (R.row(i).segment<6>(6 * b).isZero(0) && C.col(i).segment<6>(6 * b).isZero(0)) continue;
        if (first[at(i)] < 0) first[at(i)] = b;
        sets.join(b, first[at(i)]);
      }
    islands_.clear();
    R_.resize(0, 0);
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
      if (const int k = island_of[at(sets.root(b))]; k >= 0)
        for (int j = 0; j < 6; ++j) islands_[at(k)].velocities.push_back(6 * b + j);
  }
  /// MC: M^-1 C S. Derivatives by most velocities have the rows and columns of the state.
  void factor(const MatrixXd& R, const MatrixXd& MC, const VectorXd& scale) {
    if (R_.size() == R.size() && R_ == R && MC_ == MC) return;
    R_ = R;
    MC_ = MC;
    for (Island& each : islands_) {
      if (static_cast<Eigen::Index>(each.rows.size()) == R.rows())
        K_.noalias() = scale.asDiagonal() * R * MC;
      else
        K_ = scale(each.rows).asDiagonal() *
             (MatrixXd(R(each.rows, each.velocities)) * MatrixXd(MC(each.velocities, each.rows)));
      each.factor.factor(K_);
    }
  }
  /// The shortest x of K x = right, in the sense of least squares.
  VectorXd solve(const VectorXd& right) const {
    VectorXd out = VectorXd::Zero(right.size());
    for (const Island& each : islands_) out(each.rows) = each.factor.solve(right(each.rows));
    return out;
  }
  /// Work of a factorisation: the sum of the cubes of the numbers of rows.
  double work() const {
    double sum = 0;
    for (const Island& each : islands_) sum += std::pow(static_cast<double>(each.rows.size()), 3);
    return sum;
  }

 private:
  struct Island {
    std::vector<int> rows, velocities;
    linalg::LeastSquares factor;
  };
  std::vector<Island> islands_;
  MatrixXd R_, MC_;  // of the factors
  MatrixXd K_;       // of one island
};

}  // namespace tether::scene::event
