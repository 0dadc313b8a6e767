// Tether: contacts as rows, and what their forces do through the joints. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>
#include <vector>

#include "event/model/model.hpp"
#include "shared_forces.hpp"

namespace tether::scene::event {

/// Some contacts of a model at the state that is set, as a product of cones: rows L of each, and
/// what forces x in them do to velocities through the joints,
///   P L' x,   P = M^-1 - M^-1 G' (G M^-1 G')^+ G M^-1,   A = L P L'.
/// A moment comes after the contact that holds it.
class ContactRows {
 public:
  ContactRows(Model& model, std::vector<int> contacts);

  const std::vector<int>& contacts() const { return contacts_; }
  const std::vector<ConePart>& parts() const { return parts_; }  ///< of each contact
  const MatrixXd& A() const { return A_; }
  FrictionProblem problem(const VectorXd& b) const { return {A_, b, parts_}; }
  /// The values of contact k out of those by row: normal, then tangents, zero without a row.
  VectorXd of(int k, const VectorXd& values) const;
  /// Velocities by row.
  VectorXd velocities(const VectorXd& u) const { return L_ * u + rate_; }
  /// Accelerations by row without forces in them, and those of the model.
  VectorXd free_accelerations();
  VectorXd change(const VectorXd& x) const { return PL_ * x; }

 private:
  void take_rows();
  void look_at_joints();
  void free_held();
  MatrixXd joint_solve(const MatrixXd& right) const;  ///< (G M^-1 G')^+ right

  Model& model_;
  std::vector<int> contacts_;
  std::vector<ConePart> parts_;
  MatrixXd L_, PL_, A_, G_, MG_;
  VectorXd rate_, rest_, joint_rest_, scale_;
  linalg::LeastSquares factor_;
};

}  // namespace tether::scene::event
