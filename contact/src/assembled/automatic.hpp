// Tether: Method::automatic: stages by their prices. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/local_solves.hpp"
#include "assembled/stages/accelerated_sweeps.hpp"
#include "assembled/stages/admm.hpp"
#include "assembled/stages/interior/interior_point.hpp"
#include "assembled/stages/proximal_newton.hpp"

namespace tether::contact::detail {

// The stages of a solve and the order in which they take turns (README, section 10).
class Automatic {
 public:
  // Before a solve; storage is kept. proofs: whether a proof that there is no solution is looked
  // for.
  void reset(int contacts, const Options& options, bool proofs = true);
  // From the point where one sweep has not done, which search.best holds.
  Status run(Search& search);
  // A part of a larger problem, from `start`: the stages once, without replacements of the law.
  Status run_part(Search& search, const Packed& start);
  // Symptoms of the failed iteration.
  Status give_up(Search& search);

  // The normal impulses that prove infeasibility; empty: none are known.
  const Packed& proof() const { return pressed_; }

  // Started on their own by the other methods, after prepare().
  void prepare(Search& search);
  AcceleratedSweeps sweeps;
  Admm admm;
  ProximalNewton newton;
  InteriorPoint interior;

 private:
  struct Rotation;
  Status rotate(Search& search, bool last);
  bool infeasible(Search& search);
  bool at_round_off(Search& search);
  bool mostly_sticks(Search& search);
  // unsolved: other stages may.
  Status few_bodies(Search& search);
  bool replace_contacts(Search& search, double eccentricity, bool only_unconverged);
  bool sweep_first(Search& search, const Rotation& r);
  bool sweep_while_cheap(Search& search, Rotation& r);
  bool sweep_and_solve_parts(Search& search, double until);
  bool near_the_best(Search& search);
  bool interior_points(Search& search, const Rotation& r, double before);
  bool rescue(Search& search, Rotation& r);

  Options options_;
  LocalSolves parts_;
  Packed x_, z_, pressed_;
  int contacts_ = 0;
  bool ready_ = false, proofs_ = true, looked_for_proof_ = false;
  double sweep_work_ = 0;  // of the accelerated sweeps
};

}  // namespace tether::contact::detail
