// Tether: the turns of Method::automatic. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "assembled/automatic.hpp"
#include "assembled/infeasible.hpp"

namespace tether::contact::detail {
namespace {

// Sweeps that a factorisation costs, from which on sweeps go on before stages that take many of
// them.
constexpr double kDear = 30;
// Part of the error: a stage near round-off that leaves more of it does not get on.
constexpr double kGain = 0.7;

}  // namespace

// Half a factorisation of sweeps by a guess of the fill, then its exact price, for which the matrix
// is ordered: where it looks dear not before that is a small part of all. False: solved, or no work
// is left.
bool Automatic::order_after_sweeps(Search& search) {
  constexpr double kLook = 0.5, kWorth = 3;  // factorisations
  constexpr double kSmallPart = 0.1;
  const double price = interior.cost(search);
  AcceleratedSweeps::Leave leave;
  leave.partly = true;
  leave.price = kWorth * price;
  leave.least_work = kLook * price;
  if (interior.cost_by_width(search) > kDear * search.sweep_cost)
    leave.least_work = std::max(leave.least_work, interior.order_cost(search) / kSmallPart);
  sweeps.run(search, leave);
  if (search.solved() || search.exhausted()) return false;
  interior.order(search);
  return true;
}

// Sweeps in turn with solves of the parts where they do not settle, until so much work is done. A
// round that does not halve the error, once the sweeps have spread it, is followed by more sweeps:
// those that need no help are soon left alone.
void Automatic::sweep_and_solve_parts(Search& search, double until) {
  constexpr double kShare = 0.5, kCheap = 0.1, kPartShare = 0.1;      // of the work before
  constexpr double kBetween = 50, kMostBetween = 400, kGrowth = 1.4;  // sweeps
  const double begin = search.counts.work;
  double in_parts = 0, halved = search.best_error, between = kBetween;
  while (!search.solved() && !search.exhausted() && search.counts.work < until) {
    AcceleratedSweeps::Leave leave;
    leave.partly = true;
    leave.price = search.counts.work;
    leave.least_work = between * search.sweep_cost;
    leave.most_work = until - search.counts.work;
    sweeps.run(search, leave);
    if (search.solved()) return;
    if (search.best_error < 0.7 * halved) {
      halved = search.best_error;
      in_parts = 0;
      between = kBetween;
      continue;
    }
    const double before = search.counts.work;
    if (in_parts > kShare * (before - begin)) continue;
    x_.assign(sweeps.point(), sweeps.point() + contacts_);
    const bool changed = parts_.run(search, x_, kPartShare * before);
    in_parts += search.counts.work - before;
    if (!changed || in_parts > kCheap * (before - begin))
      between = std::min(kMostBetween, kGrowth * between);
    if (!changed) continue;
    search.test(x_.data(), Method::anderson);
    sweeps.replace(x_.data());
  }
}

// Sweeps for a few factorisations, and as long as they forecast less than so many.
Status Automatic::sweep(Search& search, Round& r, int factorisations) {
  constexpr double kStay = 3, kStayByBodies = 5, kStayDear = 40;  // factorisations
  const double begin = search.counts.work;
  if (!r.first || r.by_bodies || order_after_sweeps(search)) {
    const double price = interior.cost(search);
    r.dear = !r.by_bodies && price > kDear * search.sweep_cost;
    const double stay = r.by_bodies ? kStayByBodies : r.dear ? kStayDear : kStay;
    const double until = begin + stay * price;
    if (r.dear) sweep_and_solve_parts(search, until);
    if (!search.solved() && !search.exhausted()) {
      AcceleratedSweeps::Leave leave;
      leave.partly = true;
      leave.price = factorisations * price;
      leave.least_work = until - search.counts.work;
      sweeps.run(search, leave);
    }
  }
  r.swept = search.best_error;
  return Status::unsolved;
}

// Sweeps pass by a solution that repels them, and proximal problems from where they are may lead to
// it. If one of these is not solved it was the wrong place, and sweeps go on to another.
Status Automatic::proximal_path(Search& search, Round&, int problems) {
  const double end = search.work_end;
  search.work_end = std::min(end, 2 * search.counts.work);
  interior.run_proximal(search, sweeps.point(), problems, newton);
  search.work_end = end;
  return Status::unsolved;
}

// By bodies the path of interior points ends where sweeps were, or further away.
Status Automatic::interior_points(Search& search, Round& r, int steps) {
  interior.stick(search);
  if (r.by_bodies || search.solved()) return Status::unsolved;
  interior.run(search, steps);
  solve_parts_of_end(search);
  return Status::unsolved;
}

// A few proximal problems lead to a solution near which the path of interior points has ended. One
// that is not solved says that they do not, but for heavy bodies on light ones, where x has far to
// go.
Status Automatic::proximal_path_at_best(Search& search, Round&, int problems) {
  constexpr double kRough = 1e-2;
  constexpr int kMost = 60;
  if (search.best_error > kRough) return Status::unsolved;
  x_ = search.best;
  const bool loaded = search.system.load(x_.data()) > kOrdinaryLoad;
  interior.run_proximal(search, x_.data(), loaded ? kMost : problems, newton, loaded);
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

Status Automatic::arclength_path(Search& search, Round&, int factorisations) {
  interior.run_arclength(search, factorisations, newton);
  return Status::unsolved;
}

Status Automatic::proximal_newton(Search& search, Round&, int problems) {
  newton.run(search, search.best.data(), problems);
  return Status::unsolved;
}

// Looked for once in a solve, where the quick stages have failed.
bool Automatic::infeasible(Search& search) {
  if (proofs_ && !looked_for_proof_) {
    looked_for_proof_ = true;
    if (!proves_infeasible(search, pressed_)) pressed_.clear();
  }
  return !pressed_.empty();
}

Status Automatic::no_solution(Search& search, Round&, int) {
  return infeasible(search) ? Status::infeasible : Status::unsolved;
}

// Impulses of contacts wedged against each other may grow without an end along the null space of a
// singular A, beside solutions of the size of b. Proximal problems then start from much smaller
// ones.
void Automatic::proximal_path_from_small(Search& search) {
  constexpr double kGrown = 10;  // times the impulses by which all stick
  constexpr int kProblems = 60;
  if (!(interior.size_over_sticking(search, search.best.data()) > kGrown)) return;
  const double before = search.best_error;
  for (double small : {1e-3, 1e-6}) {
    x_ = search.best;
    for (PackedVector& v : x_)
      for (double& c : v.v) c *= small;
    search.system.sweep(x_.data());
    search.count_sweep();
    interior.run_proximal(search, x_.data(), kProblems, newton, true);
    if (search.solved() || search.exhausted() || search.best_error < kGain * before) return;
  }
}

// Whether what is left is what round-off makes of A x - b: its bound explains the error, and steps
// with long sums gain nothing any more. They end within 1 to 3 units of it on stacks of 100 to 2000
// boxes of masses 1 : 1e6 to 1 : 1e12.
// Steps that are stuck near the point, far above that, give way to others from further away.
bool Automatic::at_round_off(Search& search, int steps) {
  constexpr double kUnits = 4, kNearly = 100;
  while (search.explained_by_round_off() && !search.solved()) {
    const double before = search.best_error;
    const auto stuck = [&] { return search.best_error > kGain * before; };
    prepare();
    interior.run_near(search, search.best.data(), steps);
    const bool near = search.best_error < kNearly * search.options.tolerance;
    if (stuck() && near && search.best_error > kUnits * search.system.rounding(search.best.data()))
      follow_to_the_end(search);
    if (stuck() && near) proximal_path_from_small(search);
    if (stuck()) return true;
    if (search.exhausted()) return false;
  }
  return false;
}

Status Automatic::round_off(Search& search, Round&, int steps) {
  if (!at_round_off(search, steps)) return Status::unsolved;
  return infeasible(search) ? Status::infeasible : Status::round_off;
}

Status Automatic::end_of_work(Search& search, Round&, int) {
  return search.exhausted() ? Status::work_limit : Status::unsolved;
}

// Sweeps start anew where the others have gained. The solve ends after rounds that do not halve the
// error.
Status Automatic::end_of_round(Search& search, Round& r, int) {
  if (search.best_error < 0.9 * r.swept) sweeps.start(search.best.data());
  if (search.best_error > 0.5 * r.halved)
    return ++r.idle >= r.most_idle ? give_up(search) : Status::unsolved;
  r.idle = 0;
  r.halved = search.best_error;
  return Status::unsolved;
}

// Plain sweeps from the best point that keep moving are a cycle (or a wander), those that come to
// rest above the tolerance are a stall.
Status Automatic::give_up(Search& search) {
  constexpr int kSteps = 8, kSweeps = 100;
  if (infeasible(search)) return Status::infeasible;
  if (at_round_off(search, kSteps)) return Status::round_off;
  if (search.solved()) return Status::solved;
  if (search.exhausted()) return Status::work_limit;
  x_ = search.best;
  double change = 0, size = 0;
  for (int k = 0; k < kSweeps; ++k) {
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

}  // namespace tether::contact::detail
