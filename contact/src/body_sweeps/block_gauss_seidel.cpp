// Tether: block Gauss-Seidel over an island, with momentum (method, eq. 16).
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>

#include "body_sweeps/implementation.hpp"
#include "body_sweeps/sweep_control.hpp"
#include "problem/criterion.hpp"

namespace tether::contact {

namespace {

constexpr double kSlow = 15;  // with more sweeps forecast they get momentum
// The assembled problem of an island is tried once sweeps have cost kTried of its price, if further
// sweeps are forecast to cost more than kMoreExpensive times that price. Its work is bounded by
// kRuns times the price, which walls nearly need. A later attempt repeats the work of the one
// before, so it gets as much more as all attempts together, once sweeps have done as much as they.
constexpr double kTried = 0.15, kMoreExpensive = 1.25, kRuns = 4;
constexpr int kFew = 64;        // see BodyOptions::min_sweeps
constexpr double kShare = 0.1;  // of the tolerance: allowed round-off of the start

}  // namespace

// To the caller's storage, which takes the last point otherwise. The threads meet before it, since
// one may still add up what the last pass returned, and after it, since the next one moves bodies.
void BodySolver::Implementation::save(const Island& island, Team& team) {
  team.meet();
  sweeps.unpack(island, team, *out);
  team.meet();
}

// The contacts with their impulses to start from, and the scale by which the island is judged.
detail::IslandResult BodySolver::Implementation::start(const Island& island, Team& team) {
  IslandResult r;
  const PassResult b = sweeps.pack(island, team, starts);
  r.inverse_scale = detail::inverse_scale(b.most, b.sum);
  r.floor = detail::round_off(b.speed);
  const double started =
      detail::round_off(b.started);  // of a square; nothing needs a change: 0 / 0
  r.stale = started > 0 && std::sqrt(started) * r.inverse_scale > kShare * options.tolerance;
  // b = 0: no impulses; those of the last solve are dropped.
  if (b.sum == 0 && b.most == 0) sweeps.rest(island, team);
  return r;
}

// Sweeps until the island is solved or an assembled problem is forecast to cost less. Sweeps that
// max_work pays for are made in any case, more while they make progress; max_sweeps end them where
// they are not cheaper than what would follow.
struct BodySolver::Implementation::Iteration {
  using End = IslandResult::End;

  Iteration(Implementation& of, int k, Team& on)
      : solver(of),
        island(of.graph.islands[at(k)]),
        team(on),
        price(whole(), whole().islands[at(k)], of.given.first(), of.given.second()),
        best(of.options.max_sweeps) {
    const bool again = of.results[at(k)].assembled();
    r = again ? of.results[at(k)] : of.start(island, team);
    const double allowed = of.options.tolerance / r.inverse_scale;
    bound = std::max(allowed * allowed, r.floor);
    forecast = detail::Forecast(r.sweeps, r.least_change);
    next_test = island.contacts > kFew ? of.options.min_sweeps : 0;
    r.status = Status::unsolved;
    r.assembly = 0;
    if (again) best.want(r.error / r.inverse_scale);
  }

  void run() {
    for (;;) {
      const PassResult change = solver.sweeps.sweep(island, team);
      ++r.sweeps;
      forecast.add(change.sum);
      if (r.sweeps == detail::BestPoint::kFirst && !permitted()) best.want();
      const bool due = forecast.due(r.sweeps);
      const bool ends = limited(change.most) || (due && is_in_vain(change.most));
      r.end = ends ? End::at_last_point : End::none;
      if (solves(change.most)) return;
      if (ends) {
        r.status = forecast.no_progress() ? Status::cycling : Status::work_limit;
        if (permitted()) r.assembly = solver.options.max_work;
        return;
      }
      if (due && gives_way(change.most)) return;
      if (momentum) solver.sweeps.extrapolate(island, team, momentum->next(change.sum));
    }
  }

  const detail::ContactGraph& whole() const {
    return team.partners ? solver.partners->whole() : solver.graph;
  }
  bool permitted() {
    return island.contacts <= solver.options.max_assembled && price.within(solver.options.max_work);
  }
  bool is_in_vain(double most) {
    return r.sweeps > solver.options.max_work / price.sweep() &&
           forecast.in_vain(r.sweeps, most, bound, solver.options.max_sweeps);
  }
  // The user's limit, beyond which sweeps go on that cost less than the assembly would.
  bool limited(double most) {
    if (r.sweeps < solver.options.max_sweeps) return false;
    if (r.sweeps <= detail::Forecast::kFirst || !permitted()) return true;
    return r.sweeps + forecast.more(r.sweeps, most, bound) >
           solver.options.max_sweeps + price.sweeps();
  }
  // The change by a sweep is close to the residual, which would cost another pass.
  bool solves(double most) {
    if ((most > bound || r.sweeps < next_test) && island.contacts != 1 && r.end == End::none) {
      if (best.is_due(r.sweeps, most) && best.improved(solver.sweeps.test(island, team).most))
        solver.save(island, team);
      return false;
    }
    double residual = solver.sweeps.test(island, team).most;
    if (r.stale && (r.end != End::none || residual <= bound)) {
      solver.sweeps.refresh(island, team);
      r.stale = false;
      residual = solver.sweeps.test(island, team).most;
    }
    if (r.end != End::none && !best.last_is_best(residual)) {
      r.end = End::at_earlier_point;
      residual = best.residual();
    }
    r.error = r.relative(residual);
    if (residual <= bound) r.status = Status::solved;
    next_test = r.sweeps + ++failed_tests;
    return r.status == Status::solved;
  }
  // Whether an assembled problem is to be tried.
  bool gives_way(double most) {
    const double more = forecast.more(r.sweeps, most, bound);
    r.assembly = assembly(std::min(more, more_before));
    if (r.assembly > 0) return true;
    more_before = more;
    if (!momentum && more > kSlow && r.sweeps > detail::Forecast::kFirst) momentum.emplace();
    best.forecast(r.sweeps + more);
    forecast.made();
    return false;
  }
  // Work for an assembled problem where sweeps are forecast to cost more, else 0.
  double assembly(double more) {
    if (!momentum || !permitted()) return 0;
    const double once = price.sweeps(), spent = r.spent / price.sweep();
    if (r.sweeps < std::max(kTried * once, spent) || more < kMoreExpensive * once) return 0;
    return std::min(solver.options.max_work, (spent + kRuns * once) * price.sweep());
  }

  Implementation& solver;
  const Island& island;
  Team& team;
  detail::AssemblyPrice price;
  IslandResult r;
  double bound = 0;
  int next_test = 0, failed_tests = 0;
  double more_before = 0;  // forecast when it was last due
  detail::Forecast forecast{0, 0};
  std::optional<detail::Momentum> momentum;
  detail::BestPoint best;
};

void BodySolver::Implementation::iterate(int k, Team& team) {
  Iteration each(*this, k, team);
  each.run();
  each.r.least_change = each.forecast.least();
  if (team.thread == 0) results[at(k)] = each.r;
}

}  // namespace tether::contact
