// Tether: equations and Newton steps of interior points (method, eq. 21, 24).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/cone_scaling.hpp>

#include "assembled/search/search.hpp"
#include "assembled/stages/newton_matrix.hpp"

namespace tether::contact::detail {

/// A point x, u or a step, in the frame where the cone is its own dual: (mu x_n, x_t) and
/// (u_n / mu, u_t), each with its gap from the cone.
struct ConePair {
  void resize(int contacts) {
    x.resize(at(contacts));
    u.resize(at(contacts));
  }
  Packed x, u;
};

/// to += step along, gaps without cancellation.
void advance(ConePair& to, const ConePair& along, double step);

/// A x - b = w(u), w = u - s(u) (mu, gamma), for x in K and u in K* (method, eq. 21); of the
/// proximal problem A + tau D, b + tau D anchor where tau > 0.
class InteriorEquations {
 public:
  void reset(int contacts);
  void find_flat(const System& system);
  /// mu = 0: x_n and u_n alone.
  bool flat(int i) const { return flat_[at(i)] != 0; }
  const std::vector<char>& flat() const { return flat_; }

  void set_anchor(const PackedVector* x) { std::copy(x, x + n_, anchor_.begin()); }
  const Packed& anchor() const { return anchor_; }
  /// 0: the problem itself.
  void set_tau(double tau) { tau_ = tau; }
  double tau() const { return tau_; }
  /// Velocities by long sums.
  void set_exact(bool exact) { exact_ = exact; }

  /// The residual r of a point, its impulses z and their velocities.
  void evaluate(const System& system, const ConePair& point);
  const Packed& residual() const { return r_; }
  const Packed& impulses() const { return z_; }
  /// Residual of the (proximal) problem at the impulses of the last evaluate().
  double natural_map(const System& system) const;
  /// The same at other impulses, which take their place.
  double natural_map(const System& system, const PackedVector* impulses);
  /// x.u / contacts, which falls to 0 on the way.
  double complementarity(const ConePair& point) const;

 private:
  void velocities(const System& system);

  int n_ = 0;
  double tau_ = 0;
  bool exact_ = false;
  std::vector<char> flat_;
  Packed anchor_, r_, z_, w_;
};

/// Slip variable: s = |u_t| wherever u lies on the cone, that is, for sliding contacts. Inside of
/// it only w_n > 0 matters, which holds for every 0 <= c < 1; c > 0 makes s smooth at u_t = 0.
constexpr double kSmooth = 0.5;
inline double slip_of(const double* u) {
  return std::sqrt(kSmooth * u[0] * u[0] + (1 - kSmooth) * (u[1] * u[1] + u[2] * u[2]));
}

/// w += f D x, D the diagonal block.
inline void add_block(const LocalBlock& L, double f, const double* x, double* w) {
  w[0] += f * (L.a * x[0] + L.c[0] * x[1] + L.c[1] * x[2]);
  w[1] += f * (L.c[0] * x[0] + L.T[0] * x[1] + L.T[1] * x[2]);
  w[2] += f * (L.c[1] * x[0] + L.T[1] * x[1] + L.T[2] * x[2]);
}

/// Newton directions for A x - b = w(u), x o u = nu e, scaled by Nesterov and Todd: one
/// factorisation of W^-1 J^-1 P^-1 A P^-1 W^-1 + 1, any number of right-hand sides (method,
/// section 6).
class InteriorNewton {
 public:
  void reset(int contacts);
  NewtonMatrix& matrix() { return matrix_; }
  const NewtonMatrix& matrix() const { return matrix_; }

  /// At a point; false: it has reached its cone, or the matrix is singular.
  bool factor(Search& search, const InteriorEquations& equations, const ConePair& point);
  /// Towards x o u = centre e, with the residual of `equations`; corrected: with the second-order
  /// term of the predictor.
  void direction(const System& system, const InteriorEquations& equations, double centre,
                 bool corrected);
  /// Towards x o u = centre e as the matrix has it, with its shift, not refined.
  void plain_direction(const System& system, const InteriorEquations& equations, double centre);
  /// The last direction is the predictor.
  void keep_predictor();
  /// The step along the last direction at which the point reaches a cone.
  double longest_step(const InteriorEquations& equations) const;
  const ConePair& change() const { return change_; }

  /// Added to the matrix, relative to A: bounds steps along its null space, more of it where they
  /// are short.
  void reset_shift();
  void set_shift(double shift) { shift_ = shift; }
  void adapt_shift(double longest_step);

 private:
  // Around contact i the Newton matrix is left A right + 1, left = D^-1 Q J^-1 P^-1 and
  // right = P^-1 Q' D^-1; J^-1 = 1 + column gradient'.
  struct Sides {
    PackedBlock left, right;
    double column[3], gradient[3];
  };
  bool scale(const System& system, const InteriorEquations& equations, const ConePair& point);
  bool factor_contacts(const System& system, double tau);
  bool factor_bodies(const System& system, double tau);
  void diagonal(const System& system, double tau, int i, bool whole, PackedBlock& scaled) const;
  void aim(const InteriorEquations& equations, double centre, bool corrected);
  double expand(const System& system, const InteriorEquations& equations);

  int n_ = 0;
  double shift_ = 0;
  NewtonMatrix matrix_{3, 150};
  std::vector<ConeScaling> scaling_;
  std::vector<Sides> sides_;
  ConePair change_;
  ConePair scaled_, affine_;  // W dx and W^-1 du; the same of the predictor
  // In the frames of the scalings: W dx, the aim lambda \ (...) and the residual of the equations.
  Packed step_, aim_, defect_;
  Packed z_, w_, none_;  // dx as impulses, A dx, and zeros
};

}  // namespace tether::contact::detail
