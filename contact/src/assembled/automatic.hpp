// Tether: Method::automatic: stages by their prices. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/local_solves.hpp"
#include "assembled/soft_start.hpp"
#include "assembled/stages/accelerated_sweeps.hpp"
#include "assembled/stages/admm.hpp"
#include "assembled/stages/interior/interior_point.hpp"
#include "assembled/stages/proximal_newton.hpp"

namespace tether::contact::detail {

// The stages of a solve and the order in which they take turns (method, section 10).
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

  struct Rotation;
  struct Turn;

 private:
  static const Turn kRotation[], kFewBodies[];
  Status rotate(Search& search, bool last);
  Status replace_and_rotate(Search& search);
  Status rotate_from_soft(Search& search, Status status);
  template <int N>
  Status take_turns(Search& search, Rotation& r, const Turn (&turns)[N]);
  bool replace_contacts(Search& search, double eccentricity, bool only_unconverged);

  // Rows of the tables, with their budgets.
  Status sweep_while_cheap(Search& search, Rotation& r, int factorisations);
  bool sweep_before_look(Search& search);
  Status sweep_few_bodies(Search& search, Rotation& r, int factorisations);
  Status paths_from_sweeps(Search& search, Rotation& r, int paths);
  Status sticking_point(Search& search, Rotation& r, int);
  Status interior_points(Search& search, Rotation& r, int steps);
  Status interior_points_near(Search& search, Rotation& r, int steps);
  Status interior_points_at_best(Search& search, Rotation& r, int steps);
  Status directions(Search& search, Rotation& r, int iterations);
  Status proximal_newton(Search& search, Rotation& r, int problems);
  Status shifted_path(Search& search, Rotation& r, int steps);
  Status proximal_path(Search& search, Rotation& r, int problems);
  Status proximal_path_at_best(Search& search, Rotation& r, int problems);
  Status arclength_path(Search& search, Rotation& r, int factorisations);
  Status arclength_path_of_most(Search& search, Rotation& r, int factorisations);
  Status coupling_path(Search& search, Rotation& r, int factorisations);
  Status rescue(Search& search, Rotation& r, int problems);
  Status round_off(Search& search, Rotation& r, int steps);
  Status no_solution(Search& search, Rotation& r, int);
  Status end_of_work(Search& search, Rotation& r, int);
  Status end_of_round(Search& search, Rotation& r, int);
  Status patience(Search& search, Rotation& r, int);

  bool sweep_first(Search& search, const Rotation& r);
  bool sweep_and_solve_parts(Search& search, double until);
  void newton_from_sweeps(Search& search);
  void sweep_beside_parts(Search& search, AcceleratedSweeps::Leave leave);
  bool mostly_sticks(Search& search);
  bool infeasible(Search& search);
  bool at_round_off(Search& search, int steps);
  void solve_parts_of_end(Search& search);
  void follow_to_the_end(Search& search);

  Options options_;
  LocalSolves parts_, end_parts_;
  SoftStart soft_;
  Packed x_, z_, pressed_;
  int contacts_ = 0;
  bool ready_ = false, proofs_ = true, looked_for_proof_ = false;
  double sweep_work_ = 0;  // of the accelerated sweeps
  double held_work_ = 0;   // of parts that are solved again between sweeps
};

}  // namespace tether::contact::detail
