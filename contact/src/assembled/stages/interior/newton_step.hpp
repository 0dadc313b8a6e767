// Tether: the Newton step of interior points (method, eq. 24). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/cone_scaling.hpp>

#include "assembled/stages/interior/equations.hpp"
#include "assembled/stages/newton_matrix.hpp"

namespace tether::contact::detail {

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
