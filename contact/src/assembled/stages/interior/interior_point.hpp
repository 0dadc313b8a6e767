// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/stages/interior/newton_step.hpp"
#include "assembled/stages/interior/sticking_point.hpp"
#include "assembled/stages/proximal_newton.hpp"

namespace tether::contact::detail {

// Follows x o u = nu e, nu -> 0, for x in K and u = w + s (mu, gamma) in K*, w = A x - b. With
// s = s(u) the velocity w is an explicit function of u, so that one Newton matrix holds the law as
// well; it is regular for every rank of A (method, eq. 24).
class InteriorPoint {
 public:
  void reset(int contacts);
  // Tests the point where everything sticks, which run() starts from: one factorisation.
  void stick(Search& search);
  // The size of impulses over that of those by which everything sticks; 0: none are known.
  double size_over_sticking(Search& search, const PackedVector* x);
  // From the point where everything sticks; at most `most` steps. The result is search.best.
  void run(Search& search, int most);
  // From the last point of a run, and that point.
  void go_on(Search& search, int most) { follow(search, most, 0); }
  const Packed& impulses() const { return equations_.impulses(); }
  // From near x.
  void run_near(Search& search, const PackedVector* x, int most);
  // Proximal point iteration from x, at most `most` problems A + tau D, b + tau D x, which a small
  // tau D makes solvable where the path of the problem itself ends. Each is solved by a few steps
  // of `newton` from the point to which the last step leads or, where that fails, along its own
  // path. whole: where one cannot be solved a larger tau is tried, else it ends there.
  void run_proximal(Search& search, const PackedVector* x, int most, ProximalNewton& newton,
                    bool whole = false);
  // The path of run() by its arclength, through the turns where its steps are blocked; `newton`
  // finishes. At most `most` factorisations.
  void run_arclength(Search& search, int most, ProximalNewton& newton);
  // Orders the matrix, so that cost() knows its fill.
  void order(Search& search);
  bool by_bodies() const { return newton_.matrix().by_bodies(); }
  bool ordered() const { return newton_.matrix().ordered(); }
  // Estimated ns of one step; by a guess of the fill before order().
  double cost(const Search& search) const { return newton_.matrix().cost(search); }
  // Orders it at once where bodies have so many contacts that equations of bodies take the place of
  // those of contacts; returns whether they do.
  bool order_bodies(Search& search);

 private:
  struct ArclengthPath;
  bool start(Search& search);
  bool start_near(Search& search, const PackedVector* start, double near);
  bool start_proximal(Search& search, double tau, double near);
  // Puts point_ near an answer; false: there is nothing to scale it by.
  bool place_near(Search& search, const PackedVector* start, double near);
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
