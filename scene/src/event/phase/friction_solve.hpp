// Tether: impacts and modes of contacts as problems of the contact library, through the joints
// (method, eq. 7, 8). SPDX-License-Identifier: BSD-3-Clause
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
  void factor_joints();
  void free_held();
  MatrixXd joint_solve(const MatrixXd& right) const;  ///< (G M^-1 G')^+ right

  Model& model_;
  std::vector<int> contacts_;
  std::vector<ConePart> parts_;
  MatrixXd L_, PL_, A_, G_, MG_;
  VectorXd rate_, rest_, joint_rest_, scale_;
  linalg::LeastSquares factor_;
};

/// Coulomb's law, exact to round-off where the regimes that the contact library finds allow.
/// Contacts that the joints lock (A_nn = 0) carry nothing.
FrictionSolution solve_friction(const FrictionProblem& problem);

/// The same of an impact: of contacts that share their impulses all stop if the law has any
/// impulses for that; always the shortest ones. `band`: error of velocities.
FrictionSolution solve_impact(FrictionProblem problem, double band);

/// Coulomb's law for accelerations at the state that is set: w = A x - b = (a_n, a_t) where a
/// contact has no slip, and (a_n, S d + a_t) where it slides along d (else empty), S far above all
/// accelerations: the force then opposes d, whatever the accelerations are, and A stays symmetric.
/// If sliding has no forces (Painleve) the contact sticks, with x of the size of S. A bounded law
/// that slides is a force that is known.
/// Contacts that share their forces all stay at rest if the law has any forces for that, else
/// those that are `closed` stay so: the shortest forces, and then no S in w. `part`: error of the
/// accelerations.
struct AccelerationSolution {
  FrictionSolution contacts;
  double scale = 0;  ///< of the accelerations without forces
};
AccelerationSolution solve_accelerations(ContactRows& rows, const std::vector<VectorXd>& slides,
                                         double part, const std::vector<bool>& closed = {});

}  // namespace tether::scene::event
