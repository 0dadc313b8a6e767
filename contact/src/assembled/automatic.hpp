// Tether: Method::automatic: stages by their prices. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/local_solves.hpp"
#include "assembled/stages/accelerated_sweeps.hpp"
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
  // A part of a larger problem, from `start`: the stages without replacements of the law.
  Status run_part(Search& search, const Packed& start);
  // Symptoms of the failed iteration.
  Status give_up(Search& search);

  // The normal impulses that prove infeasibility; empty: none are known.
  const Packed& proof() const { return pressed_; }

  // Started on their own by the other methods, after prepare().
  void prepare();
  AcceleratedSweeps sweeps;
  ProximalNewton newton;
  InteriorPoint interior;

 private:
  // State of a solve.
  struct Round {
    bool first = true;            // the first one
    bool regular = true;          // no strongly coupled contact: the slip is differentiable
    bool by_bodies = false;       // equations of few bodies in place of those of many contacts
    bool dear = false;            // a factorisation costs many sweeps
    double swept = 0;             // error that the sweeps of this round have left
    double halved = 0;            // error when it was last halved
    int idle = 0, most_idle = 0;  // rounds that have not halved it
  };
  // A row of the table: who has a turn when, with which budget (of its own unit). unsolved: the
  // next row has its turn; anything else ends the solve.
  struct Turn {
    Status (Automatic::*stage)(Search& search, Round& r, int budget);
    bool (*admitted)(const Round& r);
    int budget;
  };
  static const Turn kTurns[];
  static bool always(const Round&) { return true; }
  static bool first_and_regular(const Round& r) { return r.first && r.regular; }
  static bool regular_and_dear(const Round& r) { return r.regular && r.dear; }
  static bool first_regular_and_cheap(const Round& r) { return r.first && r.regular && !r.dear; }
  static bool first_cheap_contacts(const Round& r) {
    return first_regular_and_cheap(r) && !r.by_bodies;
  }

  Status rotate(Search& search, int most_idle);

  // Rows of the table.
  Status sweep(Search& search, Round& r, int factorisations);
  Status proximal_path(Search& search, Round& r, int problems);
  Status interior_points(Search& search, Round& r, int steps);
  Status arclength_path(Search& search, Round& r, int factorisations);
  Status proximal_path_at_best(Search& search, Round& r, int problems);
  Status round_off(Search& search, Round& r, int steps);
  Status no_solution(Search& search, Round& r, int);
  Status proximal_newton(Search& search, Round& r, int problems);
  Status end_of_work(Search& search, Round& r, int);
  Status end_of_round(Search& search, Round& r, int);

  bool order_after_sweeps(Search& search);
  void sweep_and_solve_parts(Search& search, double until);
  void solve_parts_of_end(Search& search);
  void follow_to_the_end(Search& search);
  void proximal_path_from_small(Search& search);
  bool infeasible(Search& search);
  bool at_round_off(Search& search, int steps);

  Options options_;
  LocalSolves parts_, end_parts_;
  Packed x_, z_, pressed_;
  int contacts_ = 0;
  bool ready_ = false, proofs_ = true, looked_for_proof_ = false;
};

}  // namespace tether::contact::detail
