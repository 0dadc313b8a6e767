// Tether: Method::automatic: stages by their prices. SPDX-License-Identifier: BSD-3-Clause
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

// Rounds that do not halve the error before the solve ends, and before contacts are replaced.
constexpr int kPatience = 6, kPatienceBefore = 2;

}  // namespace

// The stages in the order of their turns, each until its budget is spent; method, section 10. All
// start from the best point, the sweeps and the proximal path from the sweeps' own.
const Automatic::Turn Automatic::kTurns[] = {
    // stage, when, budget
    {&Automatic::sweep, always, 20},                             // factorisations it may forecast
    {&Automatic::end_of_work, always, 0},                        //
    {&Automatic::proximal_path, regular_and_dear, 100},          // problems
    {&Automatic::interior_points, first_regular_and_cheap, 40},  // steps, from sticking
    {&Automatic::round_off, always, 8},                          // steps with long sums
    {&Automatic::proximal_path_at_best, first_cheap_contacts, 20},  // problems
    {&Automatic::arclength_path, first_and_regular, 800},           // factorisations
    {&Automatic::round_off, always, 8},                             // steps with long sums
    {&Automatic::end_of_work, always, 0},                           //
    {&Automatic::no_solution, always, 0},                           // once in a solve
    {&Automatic::proximal_newton, always, 12},                      // proximal problems
    {&Automatic::end_of_work, always, 0},                           //
    {&Automatic::end_of_round, always, 0},                          //
};

void Automatic::reset(int contacts, const Options& options, bool proofs) {
  contacts_ = contacts;
  options_ = options;
  proofs_ = proofs;
  pressed_.clear();
  ready_ = looked_for_proof_ = false;
}

void Automatic::prepare() {
  if (ready_) return;
  sweeps.reset(contacts_);
  newton.reset(contacts_);
  interior.reset(contacts_);
  parts_.reset(contacts_);
  ready_ = true;
}

Status Automatic::rotate(Search& search, int most_idle) {
  prepare();
  sweeps.start(search.best.data());
  Round r;
  r.halved = search.best_error;
  r.most_idle = most_idle;
  for (int i = 0; i < contacts_; ++i) {
    double gamma[2];
    search.system.gamma(i, gamma);
    r.regular = r.regular && std::hypot(gamma[0], gamma[1]) < kStronglyCoupled;
  }
  r.by_bodies = r.regular && interior.order_bodies(search);
  for (;; r.first = false) {
    for (const Turn& turn : kTurns) {
      if (!turn.admitted(r)) continue;
      const Status status = (this->*turn.stage)(search, r, turn.budget);
      if (search.confirmed()) return Status::solved;
      if (status != Status::unsolved && status != Status::solved) return status;
    }
  }
}

Status Automatic::run_part(Search& search, const Packed& start) {
  search.test(start.data(), Method::gauss_seidel);
  return search.solved() ? Status::solved : rotate(search, kPatienceBefore);
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
  if (!replaceable) return rotate(search, kPatience);
  search.work_end = kShortShare * options_.max_work;
  Status status = rotate(search, kPatienceBefore);
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
    search.test(x_.data(), Method::gauss_seidel);
    ready_ = false;
    status = search.solved()
                 ? Status::solved
                 : rotate(search, eccentricity == kCoupled ? kPatience : kPatienceBefore);
  }
  return status;
}

}  // namespace tether::contact::detail
