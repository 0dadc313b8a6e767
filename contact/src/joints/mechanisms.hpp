// Tether: all bodies, and their velocities under joints. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/joints.hpp>
#include <vector>

#include "joints/mechanism.hpp"

namespace tether::contact::detail {

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
