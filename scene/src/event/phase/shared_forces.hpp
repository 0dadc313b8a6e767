// Tether: forces of contacts that share them in more than one way (method, section 6.3).
// SPDX-License-Identifier: BSD-3-Clause
//
// For feet of one body on a plane, or corners of one face on another, accelerations may be unique
// while forces are not, and with friction several sets of regimes may obey Coulomb's law. An
// iteration ends at any of them. Here the regimes are given, and the shortest lawful forces are
// computed. They are unique, so symmetric configurations stay symmetric.
#pragma once

#include <tether/contact/problem.hpp>

namespace tether::scene::event {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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

  /// Contacts in one block after the other, of a normal and as many tangents each.
  static FrictionProblem of_contacts(const MatrixXd& A, const VectorXd& b, const VectorXd& mu);
};

/// These rows of w = A x - b, and these columns of A.
struct SomeRows {
  SomeRows(const MatrixXd& whole, const VectorXd& right, const std::vector<int>& rows);
  MatrixXd A;
  VectorXd b;
};

/// Regimes of a problem, by part. What slides has the force -limit d.
struct Regimes {
  std::vector<contact::Regime> of;
  std::vector<VectorXd> directions;  ///< d; empty where it does not slide
  std::vector<bool> fixed;           ///< d stays; else it is that of the slip
};

struct SharedForces {
  bool several = false;  ///< other forces lead to the same w
  bool lawful = false;   ///< the law allows x and w, which are set then
  VectorXd x, w;
};

/// The shortest x with no normal velocity where contacts are closed and no slip where they stick.
/// Directions that are not fixed turn to those of w.
SharedForces share_forces(const FrictionProblem& problem, Regimes& regimes);

/// Answer of a frictional problem.
struct FrictionSolution {
  bool solved = false;
  VectorXd x, w;
  std::vector<contact::Regime> regimes;
  double error = 0;
};

/// Solves the linear equations of the answer's regimes, which removes the error of the iteration:
/// stuck rows vanish, and sliding forces have their limit. Kept only if it obeys the law.
void sharpen(const FrictionProblem& problem, FrictionSolution& answer);

/// Projects b onto the range of A restricted to these rows, if that changes it by at most `band`.
/// Dependent rows contradict each other by the error of the state; no solution would obey all of
/// them.
VectorXd without_contradictions(const MatrixXd& A, const VectorXd& b, const std::vector<int>& rows,
                                double band);

}  // namespace tether::scene::event
