// Tether: forces of rows, island by island. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/linalg/least_squares.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

constexpr double kIndependentRow = 1e-6, kDependentRow = 1e-10;  // of rows of unit length
constexpr double kClearlyMoreRow = 1.1;                          // else the earlier one is taken

/// Rows that the earlier ones do not imply, in the metric of the masses; Gram and Schmidt, twice.
class IndependentRows {
 public:
  IndependentRows(const Model& model, int velocities, int rows)
      : model_(model),
        basis_(velocities, std::min(velocities, rows)),
        dual_(velocities, std::min(velocities, rows)) {}
  int rank() const { return rank_; }

  /// Whether the row, of length 1, adds to those before it.
  bool add(VectorXd v) {
    if (rank_ == basis_.cols()) return false;
    for (int pass = 0; pass < 2; ++pass)
      v -= basis_.leftCols(rank_) * (dual_.leftCols(rank_).transpose() * v);
    MatrixXd w = v;
    model_.divide_by_mass(w);
    const double length = std::sqrt(std::max(0.0, v.dot(w.col(0))));
    if (length < kIndependentRow) return false;
    basis_.col(rank_) = v / length;
    dual_.col(rank_) = w.col(0) / length;
    ++rank_;
    return true;
  }

 private:
  const Model& model_;
  MatrixXd basis_, dual_;
  int rank_ = 0;
};

/// Chooses rows (given as columns) that imply all others: each time the one that adds most to those
/// before it. Independence is measured in the metric of the projection. In that of the masses a
/// body that is thin about an axis would count as held about it by rows that hardly turn it.
struct RowChoice {
  std::vector<int> rows;  // ascending
  double least = 1;       // what a row added, of its length

  explicit RowChoice(MatrixXd V) {
    const Eigen::Index m = V.cols();
    VectorXd length = V.colwise().norm();
    for (Eigen::Index j = 0; j < m; ++j) {
      if (!(length[j] > 0)) continue;
      V.col(j) /= length[j];
      length[j] = 1;
    }
    std::vector<Eigen::Index> taken;
    while (static_cast<Eigen::Index>(rows.size()) < std::min(m, V.rows())) {
      Eigen::Index best = 0;
      for (Eigen::Index j = 1; j < m; ++j)
        if (length[j] > kClearlyMoreRow * length[best]) best = j;
      if (length[best] < kIndependentRow) break;
      // Once more against those before: what is left of it may be small.
      for (const Eigen::Index k : taken) subtract(V, k, best);
      const double left = V.col(best).norm();
      least = std::min(least, left);
      V.col(best) /= left;
      length[best] = 0;
      taken.push_back(best);
      rows.push_back(static_cast<int>(best));
      for (Eigen::Index j = 0; j < m; ++j) {
        if (!(length[j] > 0)) continue;
        subtract(V, best, j);
        length[j] = V.col(j).norm();
      }
    }
    std::sort(rows.begin(), rows.end());
  }

 private:
  static void subtract(MatrixXd& V, Eigen::Index k, Eigen::Index from) {
    V.col(from) -= V.col(k).dot(V.col(from)) * V.col(k);
  }
};

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
    std::vector<int> rows, bodies;
    linalg::LeastSquares factor;
  };
  void take(const Island& island, const MatrixXd& R, const MatrixXd& MC);

  int block_ = 1;
  std::vector<Island> islands_;
  MatrixXd R_, MC_, K_;  // of one island
};

}  // namespace tether::scene::event
