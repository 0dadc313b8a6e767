// Tether: block Gauss-Seidel over an island, with momentum. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "body_sweeps/assembly_price.hpp"
#include "body_sweeps/implementation.hpp"
#include "body_sweeps/sweep_control.hpp"
#include "problem/criterion.hpp"

namespace tether::contact {

namespace {

// More sweeps forecast than kSlow: momentum is used. More than assembly and solution are predicted
// to cost, after sweeps for kTried of that: assembled.
constexpr int kFew = 64;        // see BodyOptions::min_sweeps
constexpr double kShare = 0.1;  // of the tolerance, that round-off of the start may be
constexpr double kSlow = 15, kTried = 0.25;

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
  const bool at_once = team.partners && team.partners->relaxed();
  if (at_once) sweeps.combine(island, team, true);
  r.inverse_scale = detail::inverse_scale(b.most, b.sum);
  r.floor = detail::round_off(b.speed);
  const double started =
      detail::round_off(b.started);  // of a square; nothing needs a change: 0 / 0
  r.stale =
      !at_once && started > 0 && std::sqrt(started) * r.inverse_scale > kShare * options.tolerance;
  // b = 0: no impulses; those of the last solve are dropped.
  if (b.sum == 0 && b.most == 0) {
    sweeps.rest(island, team);
    if (at_once) sweeps.combine(island, team, true);
  }
  return r;
}

// Sweeps until the island is solved, max_sweeps are reached, or it should be assembled. Sweeps that
// max_work pays for are made in any case, more as long as they get on.
void BodySolver::Implementation::iterate(int k, Team& team) {
  const Island& island = graph.islands[at(k)];
  const bool again = results[at(k)].assembled;
  const bool permitted = !again && island.contacts <= options.max_assembled;
  const detail::WholeGraph whole =
      team.partners ? partners->whole() : detail::WholeGraph{graph, given.first(), given.second()};
  detail::AssemblyPrice price(whole.graph, whole.graph.islands[at(k)], whole.first, whole.second);
  const bool at_once = team.partners && partners->relaxed();
  IslandResult r = again ? results[at(k)] : start(island, team);
  const double allowed = options.tolerance / r.inverse_scale;
  const double bound = std::max(allowed * allowed, r.floor);
  const double paid =
      options.max_work / detail::AssemblyPrice::sweep(whole.graph.islands[at(k)].contacts);
  int next_test = island.contacts > kFew ? options.min_sweeps : 0;
  int failed_tests = 0;
  detail::AtOnce together;
  detail::Forecast forecast(r.sweeps, r.least_change);
  detail::Momentum momentum;
  detail::BestPoint best(options.max_sweeps);
  if (again) best.want(r.error / r.inverse_scale);
  // Slow even with momentum, and after a fair trial dearer than assembly and solution.
  const auto assembly_is_cheaper = [&](double more) {
    if (!permitted || !momentum.on() || !(more > r.sweeps / kTried)) return false;
    const double assembly = price.sweeps();
    return r.sweeps > kTried * assembly && more > assembly && price.within(options.max_work);
  };
  for (;;) {
    const PassResult change = sweeps.sweep(island, team);
    if (at_once) {
      sweeps.combine(island, team, false);
      if (together.grows(change.sum)) team.once([&] { partners->grew(); });
    }
    ++r.sweeps;
    forecast.add(change.sum);
    if (r.sweeps == detail::BestPoint::kFirst && !(permitted && price.within(options.max_work)))
      best.want();
    const bool due = forecast.due(r.sweeps);
    const bool limit = r.sweeps >= options.max_sweeps;
    const bool last = limit || (due && r.sweeps > paid &&
                                forecast.in_vain(r.sweeps, change.most, bound, options.max_sweeps));
    // The change by a sweep is close to the residual, which would cost another pass.
    if ((change.most <= bound && r.sweeps >= next_test) || island.contacts == 1 || last) {
      double residual = sweeps.test(island, team).most;
      if (r.stale && (last || residual <= bound)) {
        sweeps.refresh(island, team);
        r.stale = false;
        residual = sweeps.test(island, team).most;
      }
      r.saved = last && !best.last_is_best(residual);
      if (r.saved) residual = best.residual();
      r.error = r.relative(residual);
      if (residual <= bound) {
        r.status = Status::solved;
        break;
      }
      next_test = r.sweeps + ++failed_tests;
    } else if (best.look(r.sweeps, change.most) && best.improved(sweeps.test(island, team).most)) {
      save(island, team);
    }
    if (last) {
      r.status = forecast.no_progress() ? Status::cycling : Status::work_limit;
      break;
    }
    if (due) {
      const double more = forecast.more(r.sweeps, change.most, bound);
      if (assembly_is_cheaper(more)) break;
      if (more > kSlow && r.sweeps > detail::Forecast::kFirst && !at_once) momentum.start();
      best.forecast(r.sweeps + more);
      forecast.made();
    }
    if (momentum.on()) sweeps.extrapolate(island, team, momentum.next(change.sum));
  }
  r.least_change = forecast.least();
  r.assemblable = r.status != Status::solved && permitted && price.within(options.max_work);
  if (team.thread == 0) results[at(k)] = r;
}

}  // namespace tether::contact
