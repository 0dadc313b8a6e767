// Tether: the free rows of a problem over cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/SparseCholesky>
#include <tether/contact/cones.hpp>
#include <vector>

namespace tether::contact::detail {

/// Solves A_ff x = g, f the free rows, whatever the rank of A_ff: proximal steps
///
///     x <- x + (A_ff + eps)^-1 (g - A_ff x)
///
/// in units in which A_ff has a unit diagonal, eps = 1e-8, until the residual stops falling. From
/// 0 they tend to the x of least norm in those units.
class FreeRows {
 public:
  explicit FreeRows(const ConeProblem& problem);

  const std::vector<int>& rows() const { return rows_; }                      ///< of the problem
  int place(int row) const { return place_[static_cast<std::size_t>(row)]; }  ///< -1: not free
  bool empty() const { return rows_.empty(); }
  /// The free rows of v, by place; and back, into v.
  Eigen::VectorXd of(const linalg::VectorView& v) const;
  void put(const Eigen::VectorXd& free, Eigen::VectorXd& v) const;
  /// x for g, by place.
  Eigen::VectorXd solve(const Eigen::VectorXd& g) const;
  /// The same times A_cf, c the rows that are not free: rows of the problem, zero at free ones.
  Eigen::VectorXd to_cones(const Eigen::VectorXd& x) const { return coupling_ * x; }
  /// A_fc x for x by row of the problem.
  Eigen::VectorXd from_cones(const Eigen::VectorXd& x) const { return back_ * x; }
  const Eigen::SparseMatrix<double>& coupling() const { return coupling_; }  ///< A_cf
  const Eigen::SparseMatrix<double>& back() const { return back_; }          ///< A_fc
  /// Free rows (places) that hang together, for each place.
  const std::vector<int>& parts() const { return part_; }
  int part_count() const { return parts_; }

 private:
  std::vector<int> rows_, place_, part_;
  int parts_ = 0;
  Eigen::SparseMatrix<double> A_, coupling_, back_;
  Eigen::VectorXd scale_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace tether::contact::detail
