// Tether: the sweeps of Method::automatic, by the price of a factorisation.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "assembled/rotation.hpp"

namespace tether::contact::detail {
namespace {

// Sweeps that a factorisation costs, from which on sweeps go on before stages that take many of
// them.
constexpr double kDear = 30;
// Contacts from which on a solve of a few of them costs little beside some sweeps.
constexpr int kMany = 4000;

}  // namespace

// Whether the point where everything sticks may be admissible: few contacts that slide or part.
bool Automatic::mostly_sticks(Search& search) {
  z_.resize(search.best.size());
  search.system.velocities(search.best.data(), z_.data());
  const double speed = 1e-3 * search.system.norm_b() / std::sqrt(search.system.size());
  int against = 0;
  for (std::size_t i = 0; i < z_.size(); ++i) {
    const double* r = search.best[i].v;
    const double* w = z_[i].v;
    against += w[0] > speed || (r[0] > 0 && std::hypot(w[1], w[2]) > speed);
  }
  return against <= search.system.size() / 4;
}

// Half a factorisation of sweeps by a guess of the fill, then its exact price, for which the matrix
// is ordered: where it looks dear not before that is a small part of all; after as much again the
// point where all stick, if a factorisation is cheap or that point looks admissible.
bool Automatic::sweep_first(Search& search, const Rotation& r) {
  constexpr double kLookAround = 0.5;  // factorisations
  constexpr double kWorth = 3;
  constexpr double kSmallPart = 0.1;
  constexpr double kSpread = 100;  // sweeps before parts are solved
  const double begin = search.counts.work;
  for (int look = 0; look < 2; ++look) {
    AcceleratedSweeps::Leave leave;
    leave.partly = true;
    const double price = interior.cost(search);
    leave.price = kWorth * price;
    leave.least_work = kLookAround * price - (search.counts.work - begin);
    if (look == 0 && interior.cost_by_width(search) > kDear * search.sweep_cost)
      leave.least_work = std::max(leave.least_work, interior.order_cost(search) / kSmallPart);
    if (contacts_ > kMany && look == 0 && leave.least_work > kSpread * search.sweep_cost) {
      AcceleratedSweeps::Leave first = leave;
      first.most_work = kSpread * search.sweep_cost;
      sweeps.run(search, first);
      if (!search.solved()) sweep_and_solve_parts(search, begin + leave.least_work);
      leave.least_work = 0;
    }
    if (!search.solved() && !search.exhausted()) sweeps.run(search, leave);
    if (search.solved() || search.exhausted()) return search.solved();
    if (look == 0) interior.order(search);
  }
  if (r.regular && (interior.cost(search) < kDear * search.sweep_cost || mostly_sticks(search)))
    interior.stick(search);
  return search.solved();
}

// Sweeps, between which the parts that have been solved once are solved again.
void Automatic::sweep_beside_parts(Search& search, AcceleratedSweeps::Leave leave) {
  constexpr double kBetween = 10, kPartShare = 0.1;  // sweeps, of the work before
  constexpr double kHeldShare = 1.0 / 3;             // of all other work
  const double end = search.counts.work + leave.least_work;
  leave.price = 0;
  leave.most_work = kBetween * search.sweep_cost;
  while (search.counts.work < end && parts_.holds()) {
    sweeps.run(search, leave);
    if (search.solved() || search.exhausted()) return;
    const double before = search.counts.work;
    if (held_work_ > kHeldShare * (before - held_work_)) continue;
    x_.assign(sweeps.point(), sweeps.point() + contacts_);
    parts_.run_held(search, x_, kPartShare * before);
    held_work_ += search.counts.work - before;
    sweeps.amend(search, x_);
  }
}

// Near enough to a solution a few steps reach it, wherever the sweeps would go from here.
void Automatic::newton_from_sweeps(Search& search) {
  constexpr double kShare = 0.06;  // of the work before
  constexpr int kSteps = 3, kProblems = 2;
  const double budget = kShare * search.counts.work, end = search.work_end;
  if (budget < kSteps * newton.cost(search)) return;
  search.work_end = std::min(end, search.counts.work + budget);
  newton.run(search, x_.data(), kProblems);
  search.work_end = end;
}

// Sweeps in turn with solves of the parts where they do not settle, until so much work is done. A
// round that does not halve the error, once the sweeps have spread it, is followed by twice as many
// sweeps: those that need no help are soon left alone.
bool Automatic::sweep_and_solve_parts(Search& search, double until) {
  constexpr double kShare = 0.5, kCheap = 0.1, kPartShare = 0.1;      // of the work before
  constexpr double kBetween = 50, kMostBetween = 400, kGrowth = 1.4;  // sweeps
  const double begin = search.counts.work;
  constexpr double kLater = 1.5;  // times the work before
  double in_parts = 0, halved = search.best_error, between = kBetween, newton_from = begin;
  while (!search.solved() && !search.exhausted() && search.counts.work < until) {
    AcceleratedSweeps::Leave leave;
    leave.partly = true;
    leave.price = search.counts.work;
    leave.least_work = between * search.sweep_cost;
    leave.most_work = until - search.counts.work;
    if (contacts_ > kMany && parts_.holds())
      sweep_beside_parts(search, leave);
    else
      sweeps.run(search, leave);
    if (search.solved()) break;
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
    if (search.counts.work > newton_from) {
      newton_from_sweeps(search);
      newton_from = kLater * search.counts.work;
      if (search.solved()) break;
    }
    if (!changed) continue;
    search.test(x_.data(), Method::anderson);
    sweeps.replace(x_.data());
  }
  return search.solved();
}

// Sweeps until their forecast costs more than interior points. The stay before the forecast is
// asked grows with the sweeps that a factorisation costs: in large packings contacts toggle for
// hundreds of sweeps before they settle, and interior points do not serve them sooner.
Status Automatic::sweep_while_cheap(Search& search, Rotation& r, int factorisations) {
  constexpr double kStay = 40;
  const double begin = search.counts.work;
  if (!r.first || !(sweep_first(search, r) || search.exhausted())) {
    const double price = interior.cost(search);
    const double ratio = price / search.sweep_cost;
    r.dear = ratio > kDear;
    // Later as much as the other stages have taken meanwhile.
    const double share = begin - 2 * sweep_work_;
    if (r.dear) {
      sweep_and_solve_parts(search, begin + std::max(share, r.kappa * kStay * price));
    } else {
      constexpr double kShortStay = 11;
      AcceleratedSweeps::Leave leave;
      leave.partly = true;
      leave.price = factorisations * price;
      leave.least_work =
          std::max(share, r.kappa * price * (1 + kShortStay * ratio / (ratio + kDear))) -
          (search.counts.work - begin);
      sweeps.run(search, leave);
    }
    sweep_work_ += search.counts.work - begin;
  }
  r.swept = search.best_error;
  return Status::unsolved;
}

// Where a solution repels sweeps they pass it by, and proximal problems from where they are may
// lead to it: where one of these is not solved it was the wrong place, and sweeps go on to another.
Status Automatic::paths_from_sweeps(Search& search, Rotation& r, int paths) {
  constexpr double kStay = 15;  // factorisations
  constexpr int kMostProblems = 100;
  for (int path = 0; path < paths && !search.solved() && !search.exhausted(); ++path) {
    const double begin = search.counts.work, end = search.work_end;
    if (r.paths++ > 0) sweep_and_solve_parts(search, begin + kStay * interior.cost(search));
    sweep_work_ += search.counts.work - begin;
    r.swept = search.best_error;
    if (search.solved() || search.exhausted()) break;
    x_.assign(sweeps.point(), sweeps.point() + contacts_);
    search.work_end = std::min(end, 2 * search.counts.work);
    interior.run_proximal(search, x_.data(), kMostProblems, newton, false);
    search.work_end = end;
  }
  return Status::unsolved;
}

// Most problems are solved before a look at the rank of A would have paid.
bool Automatic::sweep_before_look(Search& search) {
  constexpr double kSweeps = 50;
  const double look = interior.look_cost(search);
  if (!(look > 0)) return false;
  AcceleratedSweeps::Leave leave;
  leave.partly = true;
  leave.most_work = std::max(look, kSweeps * search.sweep_cost);
  sweeps.run(search, leave);
  return search.solved();
}

// As long as they forecast less than a run of interior points: one body on hundreds of points,
// which slides on all of them, is solved by them.
Status Automatic::sweep_few_bodies(Search& search, Rotation&, int factorisations) {
  constexpr double kStay = 5;  // factorisations
  AcceleratedSweeps::Leave leave;
  leave.partly = true;
  leave.price = factorisations * interior.cost(search);
  leave.least_work = kStay * interior.cost(search);
  sweeps.run(search, leave);
  return Status::unsolved;
}

}  // namespace tether::contact::detail
