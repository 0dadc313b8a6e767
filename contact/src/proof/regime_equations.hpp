// Tether: proofs for one island in fixed regimes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <stdexcept>
#include <string>
#include <tether/contact/problem.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "proof/interval.hpp"

namespace tether::contact::detail {

using linalg::at;

/// Contact i has x_i 2^-impulse[i] for its impulses and w_i 2^-velocity[i] for its velocities: A's
/// diagonal and the largest impulse are near 1, and powers of two change no digit.
struct ProofIsland {
  int dimension = 3;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> A;
  Eigen::VectorXd b, mu, x;
  std::vector<int> impulse, velocity;

  int contacts() const { return static_cast<int>(mu.size()); }
};

/// A number of this contact would leave the range of doubles.
struct OutOfRange : std::range_error {
  OutOfRange(int of, const std::string& what) : std::range_error(what), contact(of) {}
  int contact;
};

/// Throws OutOfRange.
ProofIsland proof_island(const Problem& problem, const linalg::VectorView& impulses);

/// All points within `radius` of x, component by component.
struct Box {
  Eigen::VectorXd x, radius;

  Interval operator[](Eigen::Index row) const { return Interval::around(x[row], radius[row]); }
};

/// w = A x - b over a box.
struct Velocities {
  Velocities(const ProofIsland& island, const Box& box);

  std::vector<Interval> w;
  double size = 0;  ///< the largest |A| |x| + |b| of a row
};

/// |x_t| of a contact whose components begin at `x`.
Interval tangent_length(const Interval* x, int dimension);

/// F(x) = 0 for the contacts that touch, and its Jacobian J at x. Those that separate get x = 0.
///
///     sticking: w = 0
///     sliding:  w_n = 0,  c (x_t1 w_t2 - x_t2 w_t1) = 0,  c/2 (|x_t|^2 - mu^2 x_n^2) = 0
///
/// with c near 1 / |x_t|; in the plane x_t = +-mu x_n, without friction x_t = 0. F is quadratic.
class RegimeEquations {
 public:
  RegimeEquations(const ProofIsland& island, const std::vector<Regime>& regimes,
                  const Eigen::VectorXd& x);

  const Eigen::VectorXd& x() const { return x_; }
  Eigen::VectorXd middle() const { return values(&Interval::middle); }  ///< of F
  Eigen::VectorXd radius() const { return values(&Interval::radius); }  ///< of F
  const Eigen::MatrixXd& J() const { return J_; }                       ///< rounded
  /// At least |F(x + e) - F(x) - J e| for every |e| <= rho, with J as rounded; spread >= |A| rho.
  Eigen::VectorXd remainder(const Eigen::VectorXd& rho, const Eigen::VectorXd& spread) const;
  /// Unknowns as a vector of all contacts, with zeros.
  Eigen::VectorXd scattered(const Eigen::VectorXd& unknowns) const;

 private:
  void slide(int row, int contact);
  Eigen::VectorXd values(double (Interval::*of)() const) const;

  const ProofIsland& island_;
  const std::vector<Regime>& regimes_;
  const Eigen::VectorXd x_;
  const Velocities velocities_;
  std::vector<int> touching_;
  std::vector<Interval> F_;
  Eigen::MatrixXd J_;
  Eigen::VectorXd c_;  // by contact
};

/// Impulses near a solution and the regimes that they are in; those that separate have x = 0.
struct Candidate {
  Eigen::VectorXd x;
  std::vector<Regime> regimes;
};

/// Newton's method on the regimes' equations from the island's impulses. Nothing is promised: the
/// proof judges what comes out.
Candidate polish(const ProofIsland& island);

/// A box that holds a solution of the equations of the candidate's regimes; none: not proven.
std::optional<Box> enclose_root(const ProofIsland& island, const Candidate& candidate);

/// The first contact for which the inequalities of its regime do not hold in the whole box, given
/// its equations; -1: none.
int first_doubt(const ProofIsland& island, const std::vector<Regime>& regimes, const Box& box);

/// A point that solves the law for b' = b - change.
struct NearbySolution {
  Box box;                      ///< it lies in here
  std::vector<Regime> regimes;  ///< of the point
  Eigen::VectorXd change;       ///< at least |b' - b|, by row
};
NearbySolution nearby_solution(const ProofIsland& island, const Candidate& candidate);

}  // namespace tether::contact::detail
