// Tether: the stages of a solve and the order of their turns. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/automatic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {
namespace {

// Contacts with e above this may have no solution near under maximum_dissipation: the block map
// jumps at b_n = 0 when e > 1.
constexpr double kStronglyCoupled = 0.98;
constexpr double kCoupled = 0.8;

// Rounds that may fail to halve the error: before the solve ends, and before contacts are replaced.
constexpr int kMostIdleRounds = 6, kMostIdleRoundsBefore = 2;

// A factorisation that costs this many sweeps is expensive: sweeps then go on for long before
// stages that need many factorisations.
constexpr double kExpensive = 30;

constexpr double kGain = 0.7;  // a stage that leaves more than this part of the error has stalled

constexpr double kShare = 0.1;  // of the work before, for solves of parts

// Proximal problems where impulses have far to go: heavy bodies on light ones, wedged contacts.
constexpr int kFarProblems = 60;

// The slip is differentiable at every contact.
bool is_regular(const System& system) {
  for (int i = 0; i < system.size(); ++i) {
    double gamma[2];
    system.gamma(i, gamma);
    if (!(std::hypot(gamma[0], gamma[1]) < kStronglyCoupled)) return false;
  }
  return true;
}

}  // namespace

void Automatic::reset(int contacts, const Options& options) {
  contacts_ = contacts;
  options_ = options;
  proof_.reset();
}

// All stages start from the best point, but sweeps and the proximal path from the last sweep. Where
// the slip is not differentiable at some contact only sweeps and proximal Newton serve.
Status Automatic::rotate(Search& search, int most_idle) {
  constexpr int kProblems = 12;  // of proximal Newton
  sweeps_.reset(contacts_);
  matrix_.reset(contacts_);
  newton_.reset(contacts_);
  interior_.reset(search.system);
  parts_.reset(contacts_);
  sweeps_.start(search.best.data());
  const bool regular = is_regular(search.system);
  find_bodies(search);
  const bool by_bodies = regular && matrix_.order_by_bodies(search);
  double halved = search.best_error;
  bool first = true;
  for (int idle = 0; !search.confirmed() && !search.exhausted(); first = false) {
    const bool expensive = sweep(search, first, by_bodies);
    if (search.confirmed() || search.exhausted()) break;
    if (regular && expensive) proximal_path(search);
    if (regular && !expensive && first) interior_points(search, by_bodies);
    const bool rounding = !search.confirmed() && at_round_off(search);
    if (regular && first && !rounding) arclength_path(search, expensive || by_bodies);
    if (search.confirmed() || (search.exhausted() && !rounding)) break;
    if (infeasible(search)) return Status::infeasible;
    if (rounding) return Status::round_off;
    newton_.run(search, search.best.data(), kProblems);
    if (search.confirmed() || search.exhausted()) break;
    const bool gains = !(search.best_error > 0.5 * halved);
    if (gains) halved = search.best_error;
    idle = gains ? 0 : idle + 1;
    if (idle >= most_idle) return give_up(search);
  }
  return search.solved() ? Status::solved : Status::work_limit;
}

Status Automatic::run_part(Search& search, const Packed& start) {
  proof_.emplace();
  search.test(start.data(), By::sweeps);
  return search.solved() ? Status::solved : rotate(search, kMostIdleRoundsBefore);
}

Status Automatic::run(Search& search) {
  constexpr double kShortShare = 0.025;  // of the work, before contacts are replaced
  System& system = search.system;
  const auto coupled = [&](int i, double eccentricity) {
    return system.problem().local(i).e > eccentricity && !system.replaced(i);
  };
  bool replaceable = false;
  if (system.law().replacement && !options_.strict)
    for (int i = 0; i < contacts_; ++i) replaceable = replaceable || coupled(i, kCoupled);
  if (!replaceable) return rotate(search, kMostIdleRounds);
  search.work_end = kShortShare * options_.max_work;
  Status status = rotate(search, kMostIdleRoundsBefore);
  for (double eccentricity : {kStronglyCoupled, kCoupled}) {
    if (status == Status::solved || status == Status::infeasible) break;
    search.work_end = options_.max_work;
    if (search.exhausted()) return Status::work_limit;
    bool any = false;
    for (int i = 0; i < contacts_; ++i) {
      if (!coupled(i, eccentricity)) continue;
      system.replace(i);
      any = true;
    }
    if (!any) continue;
    x_ = search.best;
    search.best_error = std::numeric_limits<double>::infinity();
    search.test(x_.data(), By::sweeps);
    status = search.solved() ? Status::solved
                             : rotate(search, eccentricity == kCoupled ? kMostIdleRounds
                                                                       : kMostIdleRoundsBefore);
  }
  return status;
}

// Sweeps may solve the problem before it pays to look for bodies behind its matrix.
void Automatic::find_bodies(Search& search) {
  const double price = search.system.price_of_bodies();
  if (search.system.body_form() != nullptr || price > interior_.cost(search) ||
      !search.system.may_have_bodies())
    return;
  AcceleratedSweeps::Leave leave;
  leave.price = leave.least_work = leave.most_work = price;
  sweeps_.run(search, leave);
  if (search.solved() || search.exhausted()) return;
  search.system.find_bodies();
  search.counts.work += price;
}

// Sweeps for half the price of a factorisation, with a guessed fill; then orders the matrix, which
// gives the exact price. False: solved, or no work is left.
bool Automatic::order_after_sweeps(Search& search) {
  constexpr double kBeforeOrdering = 0.5, kLeaveBeyond = 3;  // factorisations
  const double price = interior_.cost(search);
  AcceleratedSweeps::Leave leave;
  leave.price = kLeaveBeyond * price;
  leave.least_work = kBeforeOrdering * price;
  sweeps_.run(search, leave);
  if (search.solved() || search.exhausted()) return false;
  matrix_.order(search);
  return true;
}

// Sweeps take turns with solves of the parts in which they do not settle, until the work `until` is
// done. Solves that do not reduce the error become rarer.
void Automatic::sweep_and_solve_parts(Search& search, double until) {
  constexpr double kBetween = 50, kMostBetween = 400, kGrowth = 1.4;  // sweeps
  const double begin = search.counts.work;
  double in_parts = 0, halved = search.best_error, between = kBetween;
  while (!search.solved() && !search.exhausted() && search.counts.work < until) {
    AcceleratedSweeps::Leave leave;
    leave.price = search.counts.work;
    leave.least_work = between * search.sweep_cost;
    leave.most_work = until - search.counts.work;
    sweeps_.run(search, leave);
    if (search.solved()) return;
    if (search.best_error < kGain * halved) {
      halved = search.best_error;
      in_parts = 0;
      between = kBetween;
      continue;
    }
    const double before = search.counts.work;
    x_.assign(sweeps_.point(), sweeps_.point() + contacts_);
    const bool changed = parts_.run(search, x_, kShare * before);
    in_parts += search.counts.work - before;
    if (!changed || in_parts > kShare * (before - begin))
      between = std::min(kMostBetween, kGrowth * between);
    if (!changed) continue;
    search.test(x_.data(), By::sweeps);
    sweeps_.replace(x_.data());
  }
}

// Sweeps for the price of a few factorisations, and longer while they forecast less than
// kLeaveBeyond of them. Returns whether a factorisation is expensive.
bool Automatic::sweep(Search& search, bool first, bool by_bodies) {
  constexpr double kStay = 3, kStayByBodies = 5, kStayIfExpensive = 40,
                   kLeaveBeyond = 20;  // factorisations
  const double begin = search.counts.work;
  if (first && !by_bodies && !order_after_sweeps(search)) return false;
  const double price = interior_.cost(search);
  const bool expensive = !by_bodies && price > kExpensive * search.sweep_cost;
  const double until = begin + (by_bodies   ? kStayByBodies
                                : expensive ? kStayIfExpensive
                                            : kStay) *
                                   price;
  if (expensive) sweep_and_solve_parts(search, until);
  if (search.solved() || search.exhausted()) return expensive;
  AcceleratedSweeps::Leave leave;
  leave.price = kLeaveBeyond * price;
  leave.least_work = until - search.counts.work;
  sweeps_.run(search, leave);
  return expensive;
}

// Sweeps may pass a solution that repels them; proximal problems from their present point may reach
// it. If one of these fails, the place was wrong, and sweeps go on to another.
void Automatic::proximal_path(Search& search) {
  constexpr int kProblems = 100;
  const double end = search.work_end;
  search.work_end = std::min(end, 2 * search.counts.work);
  interior_.run_proximal(search, sweeps_.point(), kProblems, newton_);
  search.work_end = end;
}

// With equations by bodies the path of interior points gains nothing over sweeps: only its first
// point is tested.
void Automatic::interior_points(Search& search, bool by_bodies) {
  constexpr int kSteps = 40;
  interior_.stick(search);
  if (by_bodies || search.solved()) return;
  interior_.run(search, kSteps);
  solve_parts_of_end(search);
}

// If the path of interior points ends near a solution, a few proximal problems reach it. The
// first one that fails ends the attempt, except with heavy bodies on light ones: there x has far to
// go, and more problems are allowed.
void Automatic::proximal_path_at_best(Search& search) {
  constexpr double kRough = 1e-2;
  constexpr int kProblems = 20;
  if (search.best_error > kRough) return;
  x_ = search.best;
  const bool loaded = search.system.load(x_.data()) > kOrdinaryLoad;
  interior_.run_proximal(search, x_.data(), loaded ? kFarProblems : kProblems, newton_, loaded);
}

void Automatic::arclength_path(Search& search, bool at_once) {
  constexpr int kFactorisations = 800;
  if (!at_once && !search.confirmed()) proximal_path_at_best(search);
  if (!search.confirmed()) interior_.run_arclength(search, kFactorisations, newton_);
}

// With large mass ratios the products x.u of separating contacts and of contacts under heavy bodies
// differ by more digits than a double has. Interior points then leave a few separated contacts
// unsolved, far from each other, which are solved as parts.
void Automatic::solve_parts_of_end(Search& search) {
  constexpr int kRounds = 8;
  if (!search.near_round_off() || search.solved() || search.exhausted()) return;
  const double before = search.counts.work;
  x_ = interior_.impulses();
  end_parts_.reset(contacts_);
  for (int round = 0; round < kRounds && search.counts.work < (1 + kShare) * before; ++round) {
    if (!end_parts_.run(search, x_, kShare * before)) return;
    search.test(x_.data(), By::factors);
    if (search.solved() || search.exhausted()) return;
  }
}

// Interior points from the point where everything sticks, in bursts that go on although the error
// no longer falls.
void Automatic::follow_to_the_end(Search& search) {
  constexpr int kSteps = 10, kBursts = 12;
  interior_.run(search, kSteps);
  for (int burst = 1;; ++burst) {
    solve_parts_of_end(search);
    if (burst == kBursts || search.solved() || search.exhausted()) return;
    interior_.go_on(search, kSteps);
  }
}

// Impulses of contacts wedged against each other may grow without bound along the null space of a
// singular A, although solutions of the size of b exist. Proximal problems then start from much
// smaller impulses.
void Automatic::proximal_path_from_small(Search& search) {
  constexpr double kGrown = 10;  // times the impulses by which all stick
  if (!(interior_.size_over_sticking(search, search.best.data()) > kGrown)) return;
  const double before = search.best_error;
  for (double small : {1e-3, 1e-6}) {
    x_ = search.best;
    entries(x_) *= small;
    search.system.sweep(x_.data());
    search.count_sweep();
    interior_.run_proximal(search, x_.data(), kFarProblems, newton_, true);
    if (search.solved() || search.exhausted() || search.best_error < kGain * before) return;
  }
}

// The proof is sought once in a solve, after the quick stages have failed.
bool Automatic::infeasible(Search& search) {
  if (!proof_ && !proves_infeasible(search, proof_.emplace())) proof_->clear();
  return !proof_->empty();
}

// Whether the error is the round-off of A x - b: its bound explains the error, and steps with long
// sums gain nothing. On stacks with large mass ratios they end within kUnits of that bound.
bool Automatic::at_round_off(Search& search) {
  constexpr double kUnits = 4, kNearly = 100;
  while (search.explained_by_round_off() && !search.solved()) {
    const double before = search.best_error;
    const auto stuck = [&] { return search.best_error > kGain * before; };
    const bool near = before < kNearly * search.options.tolerance;
    if (near && before > kUnits * search.system.rounding(search.best.data()))
      follow_to_the_end(search);
    if (near && stuck()) proximal_path_from_small(search);
    if (stuck()) return true;
    if (search.exhausted()) return false;
  }
  return false;
}

// Plain sweeps from the best point decide: if they keep moving the iteration cycles, if they come
// to rest above the tolerance it has stalled.
Status Automatic::give_up(Search& search) {
  constexpr int kSweeps = 100;
  if (infeasible(search)) return Status::infeasible;
  if (at_round_off(search)) return Status::round_off;
  if (search.solved()) return Status::solved;
  if (search.exhausted()) return Status::work_limit;
  x_ = search.best;
  for (int k = 0; k < kSweeps; ++k) {
    z_ = x_;
    search.system.sweep(x_.data());
    search.count_sweep();
  }
  const bool moves = (entries(x_) - entries(z_)).norm() > 1e-4 * entries(x_).norm();
  return moves ? Status::cycling : Status::stalled;
}

}  // namespace tether::contact::detail
