// Tether: bodies that joints connect (method, eq. 30). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>
#include <numeric>
#include <tether/contact/joints.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <vector>

namespace tether::contact::detail {

/// Length of a vector.
inline double norm(const std::vector<double>& u) {
  return std::sqrt(std::inner_product(u.begin(), u.end(), u.begin(), 0.0));
}

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

/// The mechanisms of a set of bodies; they are found once for each pattern of rows.
class Mechanisms {
 public:
  /// Factors of the rows, for bodies of these inverse masses. Throws std::invalid_argument on rows
  /// that name bodies that do not exist, and on values that are not finite.
  void update(const std::vector<RigidBody>& bodies, const JointRows& joints);

  int count() const { return static_cast<int>(list_.size()); }
  Mechanism& operator[](int m) { return *list_[static_cast<std::size_t>(m)]; }
  /// Mechanism of a body; -1: no joint holds it, or it does not move.
  int mechanism_of(int body) const { return mechanism_[static_cast<std::size_t>(body)]; }
  /// Its place in Mechanism::bodies().
  int place_of(int body) const { return place_[static_cast<std::size_t>(body)]; }
  bool moves(int body) const { return moves_[static_cast<std::size_t>(body)] != 0; }
  const Matrix6d& root(int body) const { return root_[static_cast<std::size_t>(body)]; }
  int bodies() const { return static_cast<int>(mechanism_.size()); }

  /// Change of u of mechanism m that the rows have made since clear_pulls(): Mechanism::entries()
  /// numbers.
  std::vector<double>& pull(int m) { return pulls_[static_cast<std::size_t>(m)]; }
  double pull_norm() const;
  void clear_pulls();
  /// v changes by the least that makes all rows hold, G v = rate.
  void satisfy(const JointRows& joints, std::vector<Vector6d>& v);
  /// Joints (ascending) with rows that cannot all hold, in the last satisfy().
  const std::vector<int>& contradicting() const { return contradicting_; }
  /// Largest |G v - rate| of a row over the largest speed in the rows of its mechanism, the sum of
  /// |G| |v| and |rate|. 0 without rows.
  double error(const JointRows& joints, const std::vector<Vector6d>& v);
  /// The impulses that make the pulls, by row.
  void impulses(double* x);
  /// v of the bodies of mechanism m changes by C u.
  void add(int m, const double* u, std::vector<Vector6d>& v) const;

 private:
  bool is_same(const std::vector<RigidBody>& bodies, const JointRows& joints) const;
  void analyse(const std::vector<RigidBody>& bodies, const JointRows& joints);
  double defect(int m, const JointRows& joints, const std::vector<Vector6d>& v);
  void find_contradicting(int m, const JointRows& joints, double scale);

  std::vector<std::unique_ptr<Mechanism>> list_;
  std::vector<int> mechanism_, place_;
  std::vector<char> moves_;
  std::vector<Matrix6d> root_;
  std::vector<Matrix6d> inverse_mass_;  // that root_ belongs to
  std::vector<int> pattern_;            // of the rows
  std::vector<std::vector<double>> pulls_;
  std::vector<double> b_, u_, x_;
  std::vector<int> contradicting_;
};

}  // namespace tether::contact::detail
