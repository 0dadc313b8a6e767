// Tether: the turns of Method::automatic besides sweeps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "assembled/infeasible.hpp"
#include "assembled/rotation.hpp"

namespace tether::contact::detail {

// Looked for once in a solve, where the quick stages have failed.
bool Automatic::infeasible(Search& search) {
  if (proofs_ && !looked_for_proof_) {
    looked_for_proof_ = true;
    if (!proves_infeasible(search, pressed_)) pressed_.clear();
  }
  return !pressed_.empty();
}

// Whether what is left is what round-off makes of A x - b: its bound explains the error, and steps
// with long sums gain nothing any more. They end within 1 to 3 units of it on stacks of 100 to 2000
// boxes of masses 1 : 1e6 to 1 : 1e12.
// Where steps near the point are stuck far above that, others come from further away.
bool Automatic::at_round_off(Search& search, int steps) {
  constexpr double kGain = 0.7, kUnits = 4, kNearly = 100;
  constexpr int kProblems = 8, kOthers = 60;
  while (search.explained_by_round_off() && !search.solved()) {
    const double before = search.best_error;
    prepare(search);
    interior.run_near(search, search.best.data(), steps);
    const auto stuck_above = [&] {
      return search.best_error > kGain * before &&
             search.best_error > kUnits * search.system.rounding(search.best.data());
    };
    if (stuck_above() && search.best_error < kNearly * search.options.tolerance)
      follow_to_the_end(search);
    if (stuck_above() && search.best_error < kNearly * search.options.tolerance) {
      x_ = search.best;
      interior.run_proximal(search, x_.data(), kProblems, newton, false);
    }
    if (stuck_above()) {
      x_ = search.best;
      interior.run_shifted(search, x_.data(), kOthers);
    }
    if (search.best_error > kGain * before) return true;
    if (search.exhausted()) return false;
  }
  return false;
}

// Plain sweeps from the best point that keep moving are a cycle (or a wander), those that come to
// rest above the tolerance are a stall.
Status Automatic::give_up(Search& search) {
  if (infeasible(search)) return Status::infeasible;
  if (at_round_off(search, kRoundOffSteps)) return Status::round_off;
  if (search.solved()) return Status::solved;
  if (search.exhausted()) return Status::work_limit;
  x_ = search.best;
  double change = 0, size = 0;
  for (int k = 0; k < 100; ++k) {
    z_ = x_;
    search.system.sweep(x_.data());
    search.count_sweep();
  }
  for (std::size_t i = 0; i < x_.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      change += (x_[i].v[c] - z_[i].v[c]) * (x_[i].v[c] - z_[i].v[c]);
      size += x_[i].v[c] * x_[i].v[c];
    }
  return change > 1e-8 * size ? Status::cycling : Status::stalled;
}

Status Automatic::end_of_work(Search& search, Rotation&, int) {
  return search.exhausted() ? Status::work_limit : Status::unsolved;
}

Status Automatic::no_solution(Search& search, Rotation&, int) {
  return infeasible(search) ? Status::infeasible : Status::unsolved;
}

Status Automatic::round_off(Search& search, Rotation&, int steps) {
  if (!at_round_off(search, steps)) return Status::unsolved;
  return infeasible(search) ? Status::infeasible : Status::round_off;
}

// Near an answer interior points need ten steps or so, after a few alternating directions.
Status Automatic::interior_points_near(Search& search, Rotation& r, int steps) {
  constexpr int kDirections = 15;
  admm.start(search, search.best.data());
  admm.run(search, kDirections, true, true);
  if (search.solved()) return Status::solved;
  return interior_points_at_best(search, r, steps);
}

Status Automatic::interior_points_at_best(Search& search, Rotation&, int steps) {
  interior.run_near(search, search.best.data(), steps);
  return Status::unsolved;
}

// Between light and heavy bodies the products x.u of a contact that parts and of one that holds a
// heavy body differ by what round-off takes: interior points end with the former too large, few
// and far from each other, and all others solved.
void Automatic::solve_parts_of_end(Search& search) {
  constexpr double kShare = 0.1;  // of the work before
  constexpr int kRounds = 8;
  if (!search.near_round_off() || search.solved() || search.exhausted()) return;
  const double before = search.counts.work;
  x_ = interior.impulses();
  end_parts_.reset(contacts_);
  for (int round = 0; round < kRounds && search.counts.work < (1 + kShare) * before; ++round) {
    if (!end_parts_.run(search, x_, kShare * before)) return;
    search.test(x_.data(), Method::interior_point);
    if (search.solved() || search.exhausted()) return;
  }
}

// From the point where everything sticks, on and on after the error has ceased to fall.
void Automatic::follow_to_the_end(Search& search) {
  constexpr int kSteps = 10, kBursts = 12;
  interior.run(search, kSteps);
  for (int burst = 1;; ++burst) {
    solve_parts_of_end(search);
    if (burst == kBursts || search.solved() || search.exhausted()) return;
    interior.go_on(search, kSteps);
  }
}

Status Automatic::interior_points(Search& search, Rotation&, int steps) {
  interior.run(search, steps);
  solve_parts_of_end(search);
  return Status::unsolved;
}

Status Automatic::directions(Search& search, Rotation&, int iterations) {
  admm.start(search, search.best.data());
  admm.run(search, iterations, true, true);
  return Status::unsolved;
}

Status Automatic::proximal_newton(Search& search, Rotation&, int problems) {
  newton.run(search, search.best.data(), problems);
  return Status::unsolved;
}

// Sweeps start anew where the others have gained; they stay twice as long in each round until the
// error has fallen by ten.
Status Automatic::end_of_round(Search& search, Rotation& r, int) {
  if (search.best_error < 0.9 * r.swept) sweeps.start(search.best.data());
  r.kappa = std::min(64.0, 2 * r.kappa);
  if (search.best_error < 0.1 * r.tenth) {
    r.tenth = search.best_error;
    r.kappa = 1;
  }
  ++r.rounds;
  return Status::unsolved;
}

// From the convex problem, which needs no start; for no more work than all before it, and than what
// is left.
Status Automatic::coupling_path(Search& search, Rotation& r, int factorisations) {
  r.coupled = true;
  const double left = search.work_end - search.counts.work;
  const double affordable = std::min(search.counts.work, left) / interior.cost(search);
  if (affordable < 1) return Status::unsolved;
  interior.run_coupling(search, static_cast<int>(std::min<double>(factorisations, affordable)));
  return Status::unsolved;
}

// Long plain alternating directions identify the active set, Newton finishes.
Status Automatic::rescue(Search& search, Rotation& r, int problems) {
  for (int k = 0; k < r.bursts && !search.exhausted(); ++k) {
    if (!admm.started()) admm.start(search, search.best.data());
    if (!admm.started()) break;
    admm.run(search, r.burst, false, false);
    if (search.solved()) return Status::solved;
    newton.run(search, admm.point(), r.outers);
    if (search.solved()) return Status::solved;
    if (r.regular) interior.run_proximal(search, admm.point(), problems, newton);
    if (search.solved()) return Status::solved;
    r.burst = std::min(20000, r.burst + r.burst / 2);
    r.outers = std::min(60, r.outers + 12);
  }
  r.bursts = std::min(16, r.bursts + 2);
  return Status::unsolved;
}

// Gives up after rescues that have not halved the error.
Status Automatic::patience(Search& search, Rotation& r, int) {
  r.rounds = 0;
  sweeps.start(search.best.data());
  if (search.best_error > 0.5 * r.halved)
    return ++r.patience >= r.most_patience ? give_up(search) : Status::unsolved;
  r.patience = 0;
  r.halved = search.best_error;
  return Status::unsolved;
}

// The interior points that follow get a quarter of the work that is left at most.
Status Automatic::sticking_point(Search& search, Rotation& r, int) {
  constexpr double kRun = 40, kShare = 0.25;
  interior.stick(search);
  // Where the path of interior points ends is no better start than where the sweeps were.
  x_ = search.best;
  r.small = kRun * interior.cost(search) < kShare * (search.work_end - search.counts.work);
  return Status::unsolved;
}

Status Automatic::shifted_path(Search& search, Rotation&, int steps) {
  x_ = search.best;
  interior.run_shifted(search, x_.data(), steps);
  x_ = search.best;
  return Status::unsolved;
}

Status Automatic::arclength_path(Search& search, Rotation&, int factorisations) {
  interior.run_arclength(search, factorisations, newton);
  x_ = search.best;
  return Status::unsolved;
}

// Where the work does not reach to the end of the path Newton steps come nearer with the last
// quarter of it than the path does.
Status Automatic::arclength_path_of_most(Search& search, Rotation& r, int factorisations) {
  constexpr double kShare = 0.75;  // of the work that is left
  constexpr int kProblems = 12;
  const double end = search.work_end, enough = search.options.enough;
  search.work_end = search.counts.work + kShare * (end - search.counts.work);
  arclength_path(search, r, factorisations);
  const bool cut = search.exhausted();
  search.work_end = end;
  if (!cut || search.solved()) return Status::unsolved;
  search.options.enough = 0;
  newton.run(search, search.best.data(), kProblems);
  search.options.enough = enough;
  x_ = search.best;
  return Status::unsolved;
}

Status Automatic::proximal_path(Search& search, Rotation&, int problems) {
  interior.run_proximal(search, x_.data(), problems, newton);
  return Status::unsolved;
}

// Where the path of interior points has ended near a solution a few proximal problems lead to it;
// one that is not solved says that they do not, but for heavy bodies on light ones, where x has
// far to go.
Status Automatic::proximal_path_at_best(Search& search, Rotation&, int problems) {
  constexpr int kMost = 60;
  x_ = search.best;
  const bool loaded = search.system.load(x_.data()) > kOrdinaryLoad;
  interior.run_proximal(search, x_.data(), loaded ? kMost : problems, newton, loaded);
  return Status::unsolved;
}

}  // namespace tether::contact::detail
