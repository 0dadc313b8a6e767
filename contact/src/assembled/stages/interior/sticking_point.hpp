// Tether: the point where every contact sticks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/stages/newton_matrix.hpp"

namespace tether::contact::detail {

/// A x = b by a matrix that is slightly shifted. Where x is admissible it is the solution, and
/// refinements remove the shift.
class StickingPoint {
 public:
  void reset(int contacts);
  /// Once for a problem: one factorisation and tests. `flat`: contacts without friction.
  void find(Search& search, NewtonMatrix& matrix, const std::vector<char>& flat);
  bool tried() const { return tried_; }
  bool found() const { return found_; }
  /// In the frame where the cone is its own dual, (mu x_n, x_t).
  const Packed& point() const { return x_; }
  /// How far the point is outside of the cone at most, and the sum of its lengths.
  double outside() const { return outside_; }
  double size() const { return size_; }

 private:
  bool factor(const Problem& problem, NewtonMatrix& matrix) const;
  void refine(Search& search, NewtonMatrix& matrix, const std::vector<char>& flat);

  bool tried_ = false, found_ = false;
  double outside_ = 0, size_ = 0;
  Packed x_, z_, w_;  // z: as impulses, w: their velocities
};

inline double mean_diagonal(const LocalBlock& L) { return (L.a + L.T[0] + L.T[2]) / 3; }

}  // namespace tether::contact::detail
