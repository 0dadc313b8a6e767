// Tether: a move that stiff components take part in as F has it. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "movers/mover.hpp"
#include "start/algebraic.hpp"
#include "step/polish.hpp"

namespace tether::ida_projection {

/// Replaces a move p by what F makes of it, z = p - J^-1 F_y p = J^-1 cj F_y' p: the step of BDF
/// from a history moved by p. Stiff components hardly move in it; p is chosen so that z ends on the
/// constraints. Contiguous vectors.
class StiffMove {
 public:
  explicit StiffMove(const AlgebraicVariables& variables) : variables_(variables) {}

  /// After mover.move(): ycor <- corrected - z. False, and ycor as it was: F, g or the linear
  /// solver fails, or z is too long. With `any_length` IDA's error test is to judge that: what is
  /// made in place of such a z excites what is stiff.
  bool make(const Candidate& candidate, double cj, Polish& polish, Mover& mover, bool any_length);
  /// After make(): may M be made of old factors?
  bool trusted() const { return trusted_; }
  /// The change of ycor by that, after mover.move().
  N_Vector change() const { return change_; }

 private:
  static constexpr int kMost = 6;  // directions
  using Vector = std::vector<double>;

  void allocate(const Candidate& candidate);
  double dot(const Vector& a, const Vector& b) const;
  bool answer(const Candidate& candidate, Polish& polish, const Vector& p, Vector& z);
  int search(const Candidate& candidate, Polish& polish, Mover& mover, double length, bool known);
  bool only_differential(const double* corrected) const;
  void combine(int count, double algebraic);
  bool too_long(double length) const;

  const AlgebraicVariables& variables_;
  const double* weights_ = nullptr;
  const double* mask_ = nullptr;
  Vector first_, moved_, left_, total_;
  Vector directions_[kMost + 1], answered_[kMost];
  double H_[kMost + 1][kMost] = {}, rhs_[kMost] = {};
  bool trusted_ = false;
  OwnedVector change_;
};

}  // namespace tether::ida_projection
