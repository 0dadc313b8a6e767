// Tether: block Gauss-Seidel over an island, with momentum (method, eq. 16).
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "body_sweeps/assembly_price.hpp"
#include "body_sweeps/implementation.hpp"
#include "body_sweeps/sweep_control.hpp"
#include "problem/criterion.hpp"

namespace tether::contact {

namespace {

constexpr double kSlow = 15;  // sweeps forecast, from which on they have momentum
// An assembled problem is tried after sweeps for kTried of its price, where they are forecast to
// cost kDearer times that, with work for kRuns of it; later with what leaves it kShareOfSweeps of
// the work of all sweeps, if that is as much as before.
constexpr double kTried = 0.15, kDearer = 1.25, kRuns = 2, kShareOfSweeps = 0.5;
constexpr int kFew = 64;        // see BodyOptions::min_sweeps
constexpr double kShare = 0.1;  // of the tolerance, that round-off of the start may be

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
void BodySolver::Implementation::iterate(int k, Team& team) {
  const Island& island = graph.islands[at(k)];
  const bool again = results[at(k)].assembled;
  const detail::ContactGraph& whole = team.partners ? partners->whole() : graph;
  detail::AssemblyPrice price(whole, whole.islands[at(k)], given.first(), given.second());
  const auto permitted = [&] {
    return island.contacts <= options.max_assembled && price.within(options.max_work);
  };
  IslandResult r = again ? results[at(k)] : start(island, team);
  const double allowed = options.tolerance / r.inverse_scale;
  const double bound = std::max(allowed * allowed, r.floor);
  const double paid = options.max_work / price.sweep();
  int next_test = island.contacts > kFew ? options.min_sweeps : 0;
  int failed_tests = 0;
  double more_before = 0;  // forecast when it was last due
  detail::Forecast forecast(r.sweeps, r.least_change);
  detail::Momentum momentum;
  detail::BestPoint best(options.max_sweeps);
  r.status = Status::unsolved;
  r.assembly = 0;
  if (again) best.want(r.error / r.inverse_scale);
  // Work for an assembled problem where sweeps are forecast to cost more, else 0.
  const auto assembly = [&](double more) -> double {
    if (!momentum.on() || !permitted()) return 0;
    const double once = price.sweeps(), spent = r.spent / price.sweep();
    const double work = std::max(kRuns * once, kShareOfSweeps * r.sweeps - spent);
    if (r.sweeps < kTried * once || more < kDearer * once || work < spent) return 0;
    return std::min(options.max_work, work * price.sweep());
  };
  // The user's limit, beyond which sweeps go on that cost less than the assembly would.
  const auto limited = [&](double most) {
    if (r.sweeps < options.max_sweeps) return false;
    if (r.sweeps <= detail::Forecast::kFirst || !permitted()) return true;
    return r.sweeps + forecast.more(r.sweeps, most, bound) > options.max_sweeps + price.sweeps();
  };
  for (;;) {
    const PassResult change = sweeps.sweep(island, team);
    ++r.sweeps;
    forecast.add(change.sum);
    if (r.sweeps == detail::BestPoint::kFirst && !permitted()) best.want();
    const bool due = forecast.due(r.sweeps);
    r.ended = limited(change.most) ||
              (due && r.sweeps > paid &&
               forecast.in_vain(r.sweeps, change.most, bound, options.max_sweeps));
    // The change by a sweep is close to the residual, which would cost another pass.
    if ((change.most <= bound && r.sweeps >= next_test) || island.contacts == 1 || r.ended) {
      double residual = sweeps.test(island, team).most;
      if (r.stale && (r.ended || residual <= bound)) {
        sweeps.refresh(island, team);
        r.stale = false;
        residual = sweeps.test(island, team).most;
      }
      r.saved = r.ended && !best.last_is_best(residual);
      if (r.saved) residual = best.residual();
      r.error = r.relative(residual);
      if (residual <= bound) {
        r.status = Status::solved;
        break;
      }
      next_test = r.sweeps + ++failed_tests;
    } else if (best.is_due(r.sweeps, change.most) &&
               best.improved(sweeps.test(island, team).most)) {
      save(island, team);
    }
    if (r.ended) {
      r.status = forecast.no_progress() ? Status::cycling : Status::work_limit;
      if (permitted()) r.assembly = options.max_work;
      break;
    }
    if (due) {
      const double more = forecast.more(r.sweeps, change.most, bound);
      r.assembly = assembly(std::min(more, more_before));
      if (r.assembly > 0) break;
      more_before = more;
      if (more > kSlow && r.sweeps > detail::Forecast::kFirst) momentum.start();
      best.forecast(r.sweeps + more);
      forecast.made();
    }
    if (momentum.on()) sweeps.extrapolate(island, team, momentum.next(change.sum));
  }
  r.least_change = forecast.least();
  if (team.thread == 0) results[at(k)] = r;
}

}  // namespace tether::contact
