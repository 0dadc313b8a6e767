// Tether: the free rows of a problem over cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/SparseCholesky>
#include <tether/contact/cones.hpp>
#include <vector>

namespace tether::contact::detail {

/// Solves A_ff x = g, where f are the free rows and A_ff may be singular, by proximal steps
///
///     x <- x + (A_ff + eps)^-1 (g - A_ff x)
///
/// in units in which A_ff has a unit diagonal, until the residual stops falling. The steps begin at
/// 0 and therefore tend to the solution of least norm in those units.
class FreeRows {
 public:
  explicit FreeRows(const ConeProblem& problem);

  const std::vector<int>& rows() const { return rows_; }  ///< their numbers in the problem
  /// Index of a row of the problem in rows(); -1: it is not free.
  int place(int row) const { return place_[static_cast<std::size_t>(row)]; }
  bool empty() const { return rows_.empty(); }
  /// of: the entries of v at free rows, in the order of rows(). put: writes them into v.
  Eigen::VectorXd of(const linalg::VectorView& v) const;
  void put(const Eigen::VectorXd& free, Eigen::VectorXd& v) const;
  /// x for g, both in the order of rows().
  Eigen::VectorXd solve(const Eigen::VectorXd& g) const;
  /// A_cf x, c the rows that are not free; the result has all rows of the problem, zero at free
  /// ones.
  Eigen::VectorXd to_cones(const Eigen::VectorXd& x) const { return coupling_ * x; }
  /// A_fc x, x with all rows of the problem; the result is in the order of rows().
  Eigen::VectorXd from_cones(const Eigen::VectorXd& x) const { return back_ * x; }
  const Eigen::SparseMatrix<double>& coupling() const { return coupling_; }  ///< A_cf
  const Eigen::SparseMatrix<double>& back() const { return back_; }          ///< A_fc
  /// For each free row the number of the connected part of A_ff that it belongs to.
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
