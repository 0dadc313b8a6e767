// Tether: contacts as rows, and what their forces do through the joints. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

/// Some contacts of a model at the state that is set: rows L = (n, T) of each, and what forces x in
/// them do to velocities through the joints,
///   P L' x,   P = M^-1 - M^-1 G' (G M^-1 G')^+ G M^-1,   A = L P L'.
/// Rows that are not there (tangents of a limit, the normal and the second tangent of a bounded
/// law, likewise of a moment, whose holder comes before it) move nothing and have a mobility of
/// their own in A, that of the row that is there.
class ContactRows {
 public:
  ContactRows(Model& model, std::vector<int> contacts);

  const std::vector<int>& contacts() const { return contacts_; }
  int size() const { return block_; }  ///< rows of a contact: n, then its tangents
  bool is_bounded(int k) const;        ///< a law of a joint, see ContactLaw
  bool has_normal(int k) const { return model_.law(contacts_[linalg::at(k)]).has_normal(); }
  /// For each contact the place of the one whose normal force bounds it, -1: its own. Empty: no
  /// moments.
  const std::vector<int>& holders() const { return holders_; }
  const MatrixXd& A() const { return A_; }
  /// Velocities of the contacts: of each w_n, then its slip.
  VectorXd velocities(const VectorXd& u) const { return L_ * u + rate_; }
  /// Accelerations of the contacts without forces in them, and those of the model.
  VectorXd free_accelerations();
  VectorXd change(const VectorXd& x) const { return PL_ * x; }

 private:
  void look_at_joints();
  void find_holders();
  void free_held_moments();
  void complete();
  MatrixXd joint_solve(const MatrixXd& right) const;  ///< (G M^-1 G')^+ right

  Model& model_;
  std::vector<int> contacts_, holders_;
  int block_;
  MatrixXd L_, PL_, A_, G_, MG_;
  VectorXd rate_, rest_, joint_rest_, scale_;
  linalg::LeastSquares factor_;
};

}  // namespace tether::scene::event
