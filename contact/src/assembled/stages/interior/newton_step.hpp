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
  void reset(const System& system);
  /// mu = 0: x_n and u_n alone.
  bool flat(int i) const { return flat_[at(i)] != 0; }
  const std::vector<char>& flat() const { return flat_; }

  void set_anchor(const PackedVector* x) { std::copy(x, x + n_, anchor_.begin()); }
  const Packed& anchor() const { return anchor_; }
  /// 0: the problem itself.
  void set_tau(double tau) { tau_ = tau; }
  double tau() const { return tau_; }
  /// The residual r of a point, its impulses z and their velocities, near round-off by long sums.
  void evaluate(const Search& search, const ConePair& point);
  const Packed& residual() const { return r_; }
  const Packed& impulses() const { return z_; }
  /// Residual of the (proximal) problem at the impulses of the last evaluate().
  double natural_map(const System& system) const;
  /// The same at other impulses, which take their place.
  double natural_map(const Search& search, const PackedVector* impulses);
  /// x.u / contacts, which falls to 0 on the way.
  double complementarity(const ConePair& point) const;

 private:
  void velocities(const Search& search);

  int n_ = 0;
  double tau_ = 0;
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
  explicit InteriorNewton(NewtonMatrix& matrix) : matrix_(matrix) {}
  void reset(int contacts);
  NewtonMatrix& matrix() { return matrix_; }
  /// Estimated ns of a step besides its factorisation; by bodies, that contains it.
  double step_cost(const Search& search) const {
    return matrix_.by_bodies() ? 0 : 150.0 * search.system.size();
  }

  /// At a point; false: it has reached its cone, or the matrix is singular.
  bool factor(Search& search, const InteriorEquations& equations, const ConePair& point);
  /// Towards x o u = centre e, with the residual of `equations`; corrected: with the second-order
  /// term of the predictor. Without refinements: as the matrix has it, with its shift.
  void direction(const System& system, const InteriorEquations& equations, double centre,
                 bool corrected, int refinements = 3);
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
  // The Newton matrix is L (A + tau D + shift) R + 1, L = D^-1 Q J^-1 P^-1 and R = P^-1 Q' D^-1 at
  // each contact; J^-1 = 1 + column gradient'.
  struct Sides {
    double column[3], gradient[3];
  };
  bool scale(const System& system, const InteriorEquations& equations, const ConePair& point);
  void aim(const InteriorEquations& equations, double centre, bool corrected);
  double expand(const System& system, const InteriorEquations& equations);

  int n_ = 0;
  double shift_ = 0;
  NewtonMatrix& matrix_;
  std::vector<ConeScaling> scaling_;
  std::vector<Sides> sides_;
  ConePair change_;
  ConePair scaled_, affine_;  // W dx and W^-1 du; the same of the predictor
  // In the frames of the scalings: W dx, the aim lambda \ (...) and the residual of the equations.
  Packed step_, aim_, defect_;
  Packed z_, w_, none_;  // dx as impulses, A dx, and zeros
};

}  // namespace tether::contact::detail
