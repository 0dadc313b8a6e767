// Tether: impacts and modes of contacts as problems of the contact library, through the joints
// (method, eq. 7, 8). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/problem.hpp>
#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

constexpr double kDependent = 1e-11;     // of rows: they depend on others
constexpr double kHeldByJoints = 1e-10;  // of a mobility without joints
constexpr double kNoForce = 1e-9;        // of the largest force
constexpr double kNoChange = 3e-9;       // of the largest acceleration or velocity

/// One contact in a product of cones, by its rows of w = A x - b: its normal, if it has one, and
/// then its slip. |slip force| <= mu x_n + bound, x_n its own normal force or that of the contact
/// that holds it, which comes before it.
struct ConePart {
  int first = 0, slips = 0;
  int normal = -1;  ///< the row of x_n; -1: there is none
  double mu = 0, bound = 0;
  double holding = 0;  ///< mu without slip

  bool has_normal() const { return normal == first; }
  bool is_held() const { return normal >= 0 && normal != first; }
  int slip() const { return has_normal() ? first + 1 : first; }
  int rows() const { return slips + (has_normal() ? 1 : 0); }
  double limit(const VectorXd& x) const { return normal < 0 ? bound : mu * x[normal] + bound; }
  auto slip_of(const VectorXd& x) const { return x.segment(slip(), slips); }
  auto slip_of(VectorXd& x) const { return x.segment(slip(), slips); }
};

/// w = A x - b over a product of cones.
struct FrictionProblem {
  MatrixXd A;
  VectorXd b;
  std::vector<ConePart> parts;
};

/// Answer of a frictional problem.
struct FrictionSolution {
  bool solved = false;
  bool shared = false;  ///< known only of share_forces: other forces lead to the same w
  VectorXd x, w;
  std::vector<contact::Regime> regimes;
  double error = 0;
};

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
  VectorXd of(int k, const VectorXd& values) const {
    const ConePart& p = parts_[at(k)];
    VectorXd out = VectorXd::Zero(1 + kTangents);
    if (p.has_normal()) out[0] = values[p.first];
    out.segment(1, p.slips) = p.slip_of(values);
    return out;
  }
  /// Velocities by row.
  VectorXd velocities(const VectorXd& u) const { return L_ * u + rate_; }
  /// Accelerations by row without forces in them, and those of the model.
  VectorXd free_accelerations() {
    VectorXd a;
    model_.forces(a);
    model_.divide_by_mass(a);
    if (G_.rows() > 0) a -= MG_ * joint_solve(G_ * a + joint_rest_);
    return L_ * a + rest_;
  }
  VectorXd change(const VectorXd& x) const { return PL_ * x; }
  /// Gives parts that share their bounds those that the forces x of an answer leave. True: they
  /// are others now.
  bool share_bounds(const FrictionSolution& answer, const std::vector<VectorXd>& slides);

 private:
  void take_rows();
  // Rows of unit length: whether one depends on others does not depend on masses.
  void factor_joints() {
    scale_.setOnes(G_.rows());
    for (int i = 0; i < G_.rows(); ++i) {
      const double square = G_.row(i).dot(MG_.col(i));
      if (square > 0) scale_[i] = 1 / std::sqrt(square);
    }
    factor_.factor(scale_.asDiagonal() * (G_ * MG_) * scale_.asDiagonal());
  }
  void free_held();
  /// (G M^-1 G')^+ right
  MatrixXd joint_solve(const MatrixXd& right) const {
    return scale_.asDiagonal() * MatrixXd(factor_.solve_columns(scale_.asDiagonal() * right));
  }

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

// Contacts may share their forces in more than one way (method, section 6.3): for feet of one body
// on a plane, or corners of one face on another, accelerations may be unique while forces are not,
// and with friction several sets of regimes may obey Coulomb's law. An iteration ends at any of
// them. With the regimes given, the shortest lawful forces are unique, so symmetric configurations
// stay symmetric.

/// Regimes of a problem, by part. What slides has the force -limit d.
struct Regimes {
  std::vector<contact::Regime> of;
  std::vector<VectorXd> directions;  ///< d; empty where it does not slide
  std::vector<bool> fixed;           ///< d stays; else it is that of the slip
};

/// The shortest x with no normal velocity where contacts are closed and no slip where they stick.
/// Directions that are not fixed turn to those of w. Solved where the law allows these forces,
/// which are shared.
FrictionSolution share_forces(const FrictionProblem& problem, Regimes& regimes);

/// Solves the linear equations of the answer's regimes, which removes the error of the iteration:
/// stuck rows vanish, and sliding forces have their limit. Kept only if it obeys the law.
void sharpen(const FrictionProblem& problem, FrictionSolution& answer);

/// Projects b onto the range of A restricted to these rows, if that changes it by at most `band`.
/// Dependent rows contradict each other by the error of the state; no solution would obey all of
/// them.
VectorXd without_contradictions(const MatrixXd& A, const VectorXd& b, const std::vector<int>& rows,
                                double band);

}  // namespace tether::scene::event
