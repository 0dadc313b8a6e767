// Tether: the stages of a solve and the order of their turns. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include "assembled/search/search.hpp"
#include "assembled/stages/accelerated_sweeps.hpp"
#include "assembled/stages/interior/interior_point.hpp"
#include "assembled/stages/proximal_newton.hpp"

namespace tether::contact::detail {

// Sweeps that go on for long do so because of few contacts: where a handful toggle between regimes
// the errors of the others decay with the distance from them. A round solves these contacts with
// their neighbours as problems of their own, the impulses of all others held: b - A x of the
// others.
class LocalSolves {
 public:
  LocalSolves();
  ~LocalSolves();
  void reset(int contacts);
  // One round, at most `budget` of work for each part. True: x has changed; it may be worse at
  // first, as what has moved disturbs the others.
  bool run(Search& search, Packed& x, double budget);

 private:
  struct Part;  // a Search and its stages
  bool find_parts(Search& search, const Packed& x);
  void add_part(const Problem& p, int seed);
  bool solve_part(Search& search, const std::vector<int>& contacts, double budget, Packed& x);

  int n_ = 0, layers_ = 1;
  int refused_ = 0;      // rounds that found too many contacts with errors of one size
  bool solved_ = false;  // a part, in the last round
  double most_ = 0;      // the largest error, as a velocity relative to its island's scale
  std::vector<double> error_;
  std::vector<int> place_;               // of each contact in its part
  std::vector<std::vector<int>> parts_;  // contacts, ascending
  std::unique_ptr<Part> part_;
};

// Looks for normal impulses d with d_n >= 0, d_t = 0, A d = 0 (to round-off) and b.d > tolerance
// times the velocity scale times the sum of d, in one island. With them d.w = -b.d for all
// impulses, so that no impulses, of any law, make every w_n >= 0 (method, section 3.4). Work is
// counted in `search`. False: none was found.
bool proves_infeasible(Search& search, Packed& d);

// The order of the methods (method, section 10).
class Automatic {
 public:
  Automatic() = default;
  Automatic(const Automatic&) = delete;
  // Called before a solve; keeps the storage.
  void reset(int contacts, const Options& options);
  // Solves from search.best, which one sweep did not solve.
  Status run(Search& search);
  // A part of a larger problem, from `start`: without replacements of the law and proofs.
  Status run_part(Search& search, const Packed& start);

  // The normal impulses that prove infeasibility; empty: none are known.
  Packed proof() const { return proof_.value_or(Packed()); }

 private:
  Status rotate(Search& search, int most_idle);
  bool sweep(Search& search, bool first, bool by_bodies);
  void find_bodies(Search& search);
  bool order_after_sweeps(Search& search);
  void sweep_and_solve_parts(Search& search, double until);
  void proximal_path(Search& search);
  void interior_points(Search& search, bool by_bodies);
  void proximal_path_at_best(Search& search);
  void arclength_path(Search& search, bool at_once);
  void solve_parts_of_end(Search& search);
  void follow_to_the_end(Search& search);
  void proximal_path_from_small(Search& search);
  bool infeasible(Search& search);
  bool at_round_off(Search& search);
  Status give_up(Search& search);

  Options options_;
  AcceleratedSweeps sweeps_;
  NewtonMatrix matrix_;
  ProximalNewton newton_{matrix_};
  InteriorPoint interior_{matrix_};
  LocalSolves parts_, end_parts_;
  Packed x_, z_;
  std::optional<Packed> proof_;  // none: not sought in this solve
  int contacts_ = 0;
};

}  // namespace tether::contact::detail
