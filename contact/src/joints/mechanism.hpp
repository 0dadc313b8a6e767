// Tether: bodies that joints connect (method, eq. 30). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/joints.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <vector>

namespace tether::contact::detail {

/// One connected set of moving bodies and the rows on them. Velocities are scaled here, u = C^-1 v
/// with C C' the inverse mass of each body, so that |u|^2 / 2 is the kinetic energy:
///
///     E u = rate,   E = G C,   P~ = 1 - E' (E E')^+ E
///
/// Rows change u by the least amount (linalg::SparseMinimumNorm).
class Mechanism {
 public:
  /// Bodies and rows by their indices, ascending; place[body]: its place in `bodies`, where it
  /// moves.
  Mechanism(std::vector<int> bodies, std::vector<int> rows, const JointRows& joints,
            const std::vector<int>& place, const std::vector<char>& moves);

  const std::vector<int>& bodies() const { return bodies_; }
  const std::vector<int>& rows() const { return rows_; }
  int entries() const { return entries_; }

  /// Takes over G; C by the index of the body. False: not finite.
  bool factor(const JointRows& joints, const std::vector<Matrix6d>& C);

  /// E u = b: the least u. b by rows(), u has entries().
  void least(const double* b, double* u) { factor_.solve(b, u); }
  /// u <- P~ u
  void project(double* u);
  /// x = E u
  void multiply(const double* u, double* x) const;
  /// The least impulses with E' x = u, u from least() or a sum of such. x by rows().
  void impulses(const double* u, double* x) { factor_.multipliers(u, x); }

  /// After least(): residual of row k of rows(), in the units of u.
  double left(int k) const { return factor_.residual(k); }
  double row_norm(int k) const { return factor_.row_norm(k); }

 private:
  std::vector<int> bodies_, rows_;
  int entries_ = 0;
  std::vector<int> starts_, columns_;
  std::vector<int> first_;      // of each term on a moving body: where its six entries begin
  std::vector<double> values_;  // of E; the factors scale theirs
  std::vector<double> b_, step_;
  linalg::SparseMinimumNorm factor_;
};

}  // namespace tether::contact::detail
