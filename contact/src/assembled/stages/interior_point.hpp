// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search.hpp"
#include "assembled/stages/newton_matrix.hpp"
#include "assembled/stages/proximal_newton.hpp"
#include "assembled/stages/sticking_point.hpp"
#include <tether/linalg/cone_scaling.hpp>

namespace tether::contact::detail {

// Follows x o u = nu e, nu -> 0, for x in K and u = w + s (mu, gamma) in K*, w = A x - b. With
// s = s(u) the velocity w is an explicit function of u, so that one Newton matrix holds the law as
// well; it is regular for every rank of A (README, section 9).
class InteriorPoint {
 public:
  void reset(int contacts);
  // Tests the point where everything sticks, which run() starts from: one factorisation.
  void stick(Search& search);
  // From the point where everything sticks; at most `most` steps. The result is search.best.
  void run(Search& search, int most);
  // From near x.
  void run_near(Search& search, const PackedVector* x, int most);
  // Proximal point iteration from x, at most `most` problems A + tau D, b + tau D x, which a small
  // tau D makes solvable where the path of the problem itself ends. Each is solved by a few steps
  // of `newton` from the point to which the last step leads or, where that fails, along its own
  // path.
  void run_proximal(Search& search, const PackedVector* x, int most, ProximalNewton& newton);
  // Orders the matrix, so that cost() knows its fill.
  void order(Search& search);
  // Estimated ns of one step; by a guess of the fill before order().
  double cost(const Search& search) const { return matrix_.cost(search); }
  // Estimated ns of order().
  double order_cost(const Search& search) const { return matrix_.order_cost(search); }
  // A guess of cost() that no order is needed for, from the width of the graph.
  double cost_by_width(const Search& search) const;
  // True, and ordered, where bodies have so many contacts that equations of bodies take the place
  // of those of contacts.
  bool order_bodies(Search& search);

 private:
  // Around contact i the Newton matrix is left A right + 1, left = D^-1 Q J^-1 P^-1 and
  // right = P^-1 Q' D^-1; J^-1 = 1 + column gradient'.
  struct Sides {
    PackedBlock left, right;
    double column[3], gradient[3];
  };
  bool start(Search& search);
  bool start_near(Search& search, const PackedVector* start, double near);
  bool start_proximal(Search& search, double tau, double near);
  // Steps until nothing is gained or, for a proximal problem, until its natural map is <= target;
  // returns that map.
  double follow(Search& search, int most, double target);
  void velocities(const System& system);
  double natural_map(const System& system) const;
  bool scale(const System& system);
  bool factor(Search& search);
  bool factor_contacts(const System& system);
  bool factor_bodies(const System& system);
  void find_flat(const System& system);
  void diagonal(const System& system, int i, bool whole, PackedBlock& scaled) const;
  void aim(double centre, bool correct);
  double expand(const System& system);
  void direction(const System& system, double centre, bool correct);
  double longest_step() const;
  double complementarity() const;  // mean of x.u
  void advance(double step);
  void residual(const System& system);

  // A point, or a step, in the frame where the cone is its own dual: (mu x_n, x_t) and
  // (u_n / mu, u_t), with their gaps.
  struct Pair {
    Packed x, u;
  };

  int n_ = 0;
  double tau_ = 0;  // of the proximal term
  double shift_ =
      0;  // added to the Newton matrix, relative to A: bounds steps along its null space
  bool exact_ = false;  // velocities by long sums
  NewtonMatrix matrix_{3, 150};
  StickingPoint sticking_;
  std::vector<ConeScaling> scaling_;
  std::vector<Sides> sides_;
  std::vector<char> flat_;  // mu = 0: x_n and u_n alone
  Pair point_, change_;
  Pair scaled_, affine_;  // W dx and W^-1 du; the same of the predictor
  // r: residual of w(u) = A x - b; z: x as impulses, w: their velocities.
  Packed r_, w_, z_, swept_, anchor_;
  // In the frames of the scalings: W dx, the aim lambda \ (...) and the residual of the equations.
  Packed step_, aim_, defect_;
};

// Slip variable: s = |u_t| wherever u lies on the cone, that is, for sliding contacts. Inside of
// it only w_n > 0 matters, which holds for every 0 <= c < 1; c > 0 makes s smooth at u_t = 0.
constexpr double kSmooth = 0.5;
inline double slip_of(const double* u) {
  return std::sqrt(kSmooth * u[0] * u[0] + (1 - kSmooth) * (u[1] * u[1] + u[2] * u[2]));
}

}  // namespace tether::contact::detail
