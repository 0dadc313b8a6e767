// Tether: forces of contacts that share them in more than one way (method, section 6.3).
// SPDX-License-Identifier: BSD-3-Clause
//
// Feet of one body on a plane, corners of one face on another: accelerations may be unique, forces
// are not, and with friction several sets of regimes may obey Coulomb's law. An iteration ends at
// any of them; here the regimes are given, and the answer is the shortest of all forces that the
// law allows with them. It is unique, so that what is symmetric stays symmetric.
#pragma once

#include <tether/contact/problem.hpp>

namespace tether::scene::event {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// For each contact of a problem, the contact whose normal force bounds it, as in |moment| <=
/// r x_n. Such a contact has tangents only, its x_n is zero, and it comes after its holder. -1: it
/// has its own normal force. Empty: all have.
using Holders = std::vector<int>;
inline bool is_held(const Holders& holders, int contact) {
  return !holders.empty() && holders[static_cast<std::size_t>(contact)] >= 0;
}

/// These rows of w = A x - b, and these columns of A.
struct SomeRows {
  SomeRows(const MatrixXd& whole, const VectorXd& right, const std::vector<int>& rows);
  MatrixXd A;
  VectorXd b;
};

/// Regimes of a problem w = A x - b. Where a contact slides: x_t = -mu x_n d.
struct Regimes {
  std::vector<contact::Regime> of;
  std::vector<VectorXd> directions;  ///< d; empty where it does not slide
  std::vector<bool> fixed;           ///< d stays; else it is that of w_t
  Holders holders;
};

struct SharedForces {
  bool several = false;  ///< other forces lead to the same w
  bool lawful = false;   ///< the law allows x and w, which are set then
  VectorXd x, w;
};

/// w_n = 0 where contacts are closed, w_t = 0 where they stick. Directions that are not fixed turn
/// to those of w.
SharedForces share_forces(const MatrixXd& A, const VectorXd& b, const VectorXd& mu,
                          Regimes& regimes);

/// Answer of a frictional problem w = A x - b.
struct FrictionAnswer {
  bool solved = false;
  VectorXd x, w;
  std::vector<contact::Regime> regimes;
  double error = 0;
};

/// The same regimes without the error of an iteration, where that is an answer of the law, too:
/// stuck rows vanish, and where a contact slides x_t = -mu x_n d, d the direction of w_t.
void sharpen(const MatrixXd& A, const VectorXd& b, const VectorXd& mu, const Holders& holders,
             FrictionAnswer& answer);

/// b of w = A x - b without what no x can do in these rows, which depend on each other, where that
/// is at most `band`: the error of a state makes them contradict each other, and an answer that
/// holds all of them would not exist.
VectorXd without_contradictions(const MatrixXd& A, const VectorXd& b, const std::vector<int>& rows,
                                double band);

}  // namespace tether::scene::event
