// Tether: forces of rows, island by island. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/least_squares.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

/// K = S R M^-1 C S of rows R and columns C, S a diagonal. Rows of bodies that no row connects do
/// not meet in it: each such island has factors of its own.
class RowIslands {
 public:
  /// By what rows and columns are not zero in; bodies have `block` velocities each.
  void choose(const MatrixXd& R, const MatrixXd& C, int block);
  /// MC: M^-1 C S.
  void factor(const MatrixXd& R, const MatrixXd& MC, const VectorXd& scale);
  /// The shortest x of K x = right, in the sense of least squares.
  VectorXd solve(const VectorXd& right) const;
  /// Work of a factorisation: the sum of the cubes of the numbers of rows.
  double work() const;

 private:
  struct Island {
    std::vector<int> rows, velocities;
    linalg::LeastSquares factor;
  };
  std::vector<Island> islands_;
  MatrixXd K_;  // of one island
};

}  // namespace tether::scene::event
