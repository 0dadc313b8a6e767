// Tether: a problem over cones as one of 3-D friction cones (method, section 8).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/SparseCholesky>
#include <tether/contact/cones.hpp>
#include <tether/contact/problem.hpp>
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

/// Every row that is not free becomes a component of a contact, in units of row_scale(). Components
/// (normal, tangent, tangent) that have no row are marked `own`; no other row couples to them:
///
///     nonnegative   (row, own, own), mu = 0
///     bounded       (own, row, own), mu = 1; b_n of the own normal makes x_n = bound
///     planar        (row, row, own)
///     friction      (row, row, row)
///     moments       (own, row, own) and (own, row, row), mu = length; w_n = a (x_n - x_n of the
///                   contact) makes both x_n equal, and A unsymmetric
///
/// Free rows are eliminated from the matrix of these rows: A_cc - A_cf A_ff^-1 A_fc.
class Embedding {
 public:
  /// `open`: for each block, 1 if its contact is known to be open; empty: none is. The normals of
  /// its moments then get w_n > 0, since x_n = w_n = 0 would be a kink for derivatives.
  Embedding(const ConeProblem& problem, double tolerance, const std::vector<char>& open = {});

  const Problem& contacts() const { return contacts_; }
  const FreeRows& free_rows() const { return free_; }
  const std::vector<int>& blocked() const { return blocked_; }
  int block_of(int contact) const { return block_of_[static_cast<std::size_t>(contact)]; }
  /// Contact whose normal is the block's; -1: none, or held.
  int main_contact(int block) const { return main_[static_cast<std::size_t>(block)]; }

  Eigen::VectorXd lift(const linalg::VectorView& impulses) const;
  /// From components of contacts to rows of the problem; free rows are zero.
  Eigen::VectorXd lower(const linalg::VectorView& contacts) const {
    return raise_.transpose() * contacts;
  }
  /// The transpose of lower(): from rows to components of contacts.
  Eigen::VectorXd raise(const linalg::VectorView& gradient) const { return raise_ * gradient; }
  /// Adds the free rows to those of the cones: A_ff x_f = g_f - A_fc x_c.
  Eigen::VectorXd complete(const Eigen::VectorXd& cones, const linalg::VectorView& g) const;

  /// Change of the contacts' b that a change of the problem's b causes.
  Eigen::VectorXd lift_b(const linalg::VectorView& db) const;
  /// The transpose of lift_b().
  Eigen::VectorXd lower_b(const linalg::VectorView& db3) const;
  /// A bound N of a block enters the contacts as b_n = factor N of this contact; -1: no bound.
  struct Bound {
    int contact = -1;
    double factor = 0;
  };
  Bound bound_of(int block) const { return bounds_[static_cast<std::size_t>(block)]; }
  /// Contacts of the moments of a block (-1: none). Their mu is `factor` times the length.
  struct Moments {
    int spin = -1, rolling = -1;
    double spin_factor = 0, rolling_factor = 0;
  };
  const Moments& moments_of(int block) const { return moments_[static_cast<std::size_t>(block)]; }

 private:
  struct Place {
    int contact = -1, component = 0;
  };
  void eliminate(const ConeProblem& problem);
  std::vector<std::vector<int>> rows_seeing_parts() const;
  void eliminate_columns(const ConeProblem& problem, const std::vector<std::vector<int>>& seeing,
                         std::size_t k, std::vector<Eigen::Triplet<double>>& entries) const;
  void place_rows(const ConeProblem& problem, double tolerance);
  void clear_held(const ConeProblem& problem);
  void assemble(const ConeProblem& problem, const std::vector<char>& open);

  FreeRows free_;
  Eigen::SparseMatrix<double, Eigen::RowMajor> A_;  // of the cones' rows, scaled, eliminated
  Eigen::VectorXd b_, scale_;
  Eigen::SparseMatrix<double> raise_;  // rows to components, in units of scale_
  std::vector<Place> places_;          // by row
  std::vector<int> block_of_, main_, blocked_;
  std::vector<Bound> bounds_;
  std::vector<Moments> moments_;
  std::vector<double> mu_;
  double need_ = 0;
  Problem contacts_;
};

/// The largest velocity scale of a block, times row_scale().
double largest_need(const ConeProblem& problem);

}  // namespace tether::contact::detail
