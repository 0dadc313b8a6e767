// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/stages/interior/newton_step.hpp"
#include "assembled/stages/newton_matrix.hpp"
#include "assembled/stages/proximal_newton.hpp"

namespace tether::contact::detail {

/// A x = b by a matrix that is slightly shifted. Where x is admissible it is the solution, and
/// refinements remove the shift.
class StickingPoint {
 public:
  void reset(int contacts);
  /// Once for a problem: one factorisation and tests. `flat`: contacts without friction.
  void find(Search& search, NewtonMatrix& matrix, const std::vector<char>& flat);
  bool found() const { return state_ == State::found; }
  /// In the frame where the cone is its own dual, (mu x_n, x_t).
  const Packed& point() const { return x_; }
  /// How far the point is outside of the cone at most, and the sum of its lengths.
  double outside() const { return outside_; }
  double size() const { return size_; }

 private:
  bool factor(Search& search, NewtonMatrix& matrix) const;
  void refine(Search& search, NewtonMatrix& matrix, const std::vector<char>& flat);

  enum class State { unknown, none, found } state_ = State::unknown;
  double outside_ = 0, size_ = 0;
  Packed x_, z_, w_;  // z: as impulses, w: their velocities
};

// Follows x o u = nu e, nu -> 0, for x in K and u = w + s (mu, gamma) in K*, w = A x - b. With
// s = s(u) the velocity w is an explicit function of u, so that one Newton matrix holds the law as
// well; it is regular for every rank of A (method, eq. 24).
class InteriorPoint {
 public:
  explicit InteriorPoint(NewtonMatrix& matrix) : newton_(matrix) {}
  void reset(const System& system);
  // Tests the point where everything sticks, which run() starts from: one factorisation.
  void stick(Search& search);
  // The size of impulses over that of those by which everything sticks; 0: none are known.
  double size_over_sticking(Search& search, const PackedVector* x);
  // From the point where everything sticks; at most `most` steps. The result is search.best.
  void run(Search& search, int most);
  // From the last point of a run, and that point.
  void go_on(Search& search, int most) { follow(search, most, 0); }
  const Packed& impulses() const { return equations_.impulses(); }
  // Proximal point iteration from x, at most `most` problems A + tau D, b + tau D x, which a small
  // tau D makes solvable where the path of the problem itself ends. Each is solved by a few steps
  // of `newton` from the point to which the last step leads or, where that fails, along its own
  // path. whole: where one cannot be solved a larger tau is tried, else it ends there.
  void run_proximal(Search& search, const PackedVector* x, int most, ProximalNewton& newton,
                    bool whole = false);
  // The path of run() by its arclength, through the turns where its steps are blocked; `newton`
  // finishes. At most `most` factorisations.
  void run_arclength(Search& search, int most, ProximalNewton& newton);
  // Estimated ns of one step.
  double cost(const Search& search) { return matrix().cost(search) + newton_.step_cost(search); }
  NewtonMatrix& matrix() { return newton_.matrix(); }

 private:
  struct ArclengthPath;
  bool start(Search& search);
  // Puts point_ near an answer, in the proximal problem around it where tau > 0; false: there is
  // nothing to scale it by.
  bool start_near(Search& search, const PackedVector* start, double near, double tau = 0);
  // Steps until nothing is gained or, for a proximal problem, until its natural map is <= target;
  // returns that map.
  double follow(Search& search, int most, double target);
  double aim(const System& system, double mean, double last);
  double test_point(Search& search);

  int n_ = 0;
  InteriorEquations equations_;
  InteriorNewton newton_;
  StickingPoint sticking_;
  ConePair point_;
  Packed swept_;
};

}  // namespace tether::contact::detail
