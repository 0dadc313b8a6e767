// Tether: the stages of a solve and the order of their turns. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/local_solves.hpp"
#include "assembled/stages/accelerated_sweeps.hpp"
#include "assembled/stages/interior/interior_point.hpp"
#include "assembled/stages/proximal_newton.hpp"

namespace tether::contact::detail {

// The order of the methods (method, section 10).
class Automatic {
 public:
  // Called before a solve; keeps the storage. proofs: whether to seek a proof of infeasibility.
  void reset(int contacts, const Options& options, bool proofs = true);
  // Solves from search.best, which one sweep did not solve.
  Status run(Search& search);
  // A part of a larger problem, from `start`: the stages without replacements of the law.
  Status run_part(Search& search, const Packed& start);

  // The normal impulses that prove infeasibility; empty: none are known.
  const Packed& proof() const { return proof_; }

 private:
  void prepare();
  Status rotate(Search& search, int most_idle);
  bool sweep(Search& search, bool first, bool by_bodies);
  void find_bodies(Search& search);
  bool order_after_sweeps(Search& search);
  void sweep_and_solve_parts(Search& search, double until);
  void proximal_path(Search& search);
  void interior_points(Search& search, bool by_bodies);
  void proximal_path_at_best(Search& search);
  void solve_parts_of_end(Search& search);
  void follow_to_the_end(Search& search);
  void proximal_path_from_small(Search& search);
  bool infeasible(Search& search);
  bool at_round_off(Search& search);
  Status give_up(Search& search);

  Options options_;
  AcceleratedSweeps sweeps_;
  ProximalNewton newton_;
  InteriorPoint interior_;
  LocalSolves parts_, end_parts_;
  Packed x_, z_, proof_;
  int contacts_ = 0;
  bool ready_ = false, proofs_ = true, sought_proof_ = false;
};

}  // namespace tether::contact::detail
