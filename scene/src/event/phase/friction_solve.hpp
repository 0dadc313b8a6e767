// Tether: impacts and modes of contacts as problems of the contact library, through the joints.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/solver.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

/// Some contacts of a model at the state that is set: rows L = (n, T) of each, and what forces x in
/// them do to velocities through the joints,
///   P L' x,   P = M^-1 - M^-1 G' (G M^-1 G')^+ G M^-1,   A = L P L'.
class ContactRows {
 public:
  ContactRows(Model& model, std::vector<int> contacts);

  const std::vector<int>& contacts() const { return contacts_; }
  int size() const { return block_; }  ///< rows of a contact: n, then its tangents
  const MatrixXd& A() const { return A_; }
  /// Velocities of the contacts: of each w_n, then its slip.
  VectorXd velocities(const VectorXd& u) const { return L_ * u + rate_; }
  /// Accelerations of the contacts without forces in them, and those of the model.
  VectorXd free_accelerations();
  VectorXd change(const VectorXd& x) const { return PL_ * x; }

 private:
  void look_at_joints();
  MatrixXd joint_solve(const MatrixXd& right) const;  ///< (G M^-1 G')^+ right

  Model& model_;
  std::vector<int> contacts_;
  int block_;
  MatrixXd L_, PL_, A_, G_, MG_;
  VectorXd rate_, rest_, joint_rest_, scale_;
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> factor_;
};

/// Answer of a frictional problem w = A x - b.
struct FrictionAnswer {
  bool solved = false;
  VectorXd x, w;
  std::vector<contact::Regime> regimes;
  double error = 0;
};

/// Coulomb's law, exact to round-off where the regimes that the contact library finds allow.
/// Contacts that the joints lock (A_nn = 0) carry nothing.
FrictionAnswer solve_friction(const MatrixXd& A, const VectorXd& b, const VectorXd& mu);

/// The same of an impact: of contacts that share their impulses all stop if the law has any
/// impulses for that; always the shortest ones. `band`: error of velocities.
FrictionAnswer solve_impact(const MatrixXd& A, const VectorXd& b, const VectorXd& mu, double band);

/// Coulomb's law for accelerations at the state that is set: w = A x - b = (a_n, a_t) where a
/// contact has no slip, and (a_n, S d + a_t) where it slides along d (else empty), S far above all
/// accelerations: the force then opposes d, whatever the accelerations are, and A stays symmetric.
/// Where sliding has no forces (Painleve) the contact sticks, with x of the size of S.
/// Of contacts that share their forces all stay at rest if the law has any forces for that, else
/// those that are `closed` stay so: the shortest forces, and then no S in w. `part`: error of the
/// accelerations.
struct AccelerationAnswer {
  FrictionAnswer contacts;
  double scale = 0;  ///< of the accelerations without forces
  double far = 0;    ///< S
};
AccelerationAnswer solve_accelerations(const Model& model, ContactRows& rows,
                                       const std::vector<VectorXd>& slides, double part,
                                       const std::vector<bool>& closed = {});

}  // namespace tether::scene::event
