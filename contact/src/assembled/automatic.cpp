// Tether: Method::automatic: stages by their prices. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/automatic.hpp"

#include <algorithm>
#include <cmath>

#include "assembled/rotation.hpp"

namespace tether::contact::detail {
namespace {

// Contacts with e above this may have no solution near under maximum_dissipation: the block map
// jumps at b_n = 0 when e > 1.
constexpr double kStronglyCoupled = 0.98;
constexpr double kCoupled = 0.8;

// Who has a turn.
typedef Automatic::Rotation Rotation;
bool always(const Search&, const Rotation&) { return true; }
// Below these errors interior points start near the best point.
constexpr double kNear = 1e-3, kRough = 1e-2;
bool first_and_near(const Search&, const Rotation& r) {
  return r.first && r.regular && r.swept < kNear;
}
bool first_and_far_or_cheap(const Search&, const Rotation& r) {
  return r.first && r.regular && (r.swept >= kNear || !r.dear);
}
bool first_that_came_near(const Search& search, const Rotation& r) {
  return r.first && r.regular && r.swept >= kRough && search.best_error < kRough;
}
// Where factorisations are dear sweeps go on before stages that take many.
bool unless_first_and_dear(const Search&, const Rotation& r) {
  return !(r.first && r.regular && r.dear);
}
bool every_second_round(const Search&, const Rotation& r) { return r.rounds == 2; }
bool first_and_dear(const Search&, const Rotation& r) { return r.first && r.regular && r.dear; }
bool first_and_cheap(const Search&, const Rotation& r) { return r.first && r.regular && !r.dear; }
bool first_cheap_and_near(const Search& search, const Rotation& r) {
  return first_and_cheap(search, r) && search.best_error < kRough;
}
bool second_round_once(const Search&, const Rotation& r) {
  return r.rounds == 2 && r.regular && !r.coupled;
}
bool at_a_small_price(const Search&, const Rotation& r) { return r.small; }

}  // namespace

// The stages in the order of their turns, each until its budget is spent; method, section 10. All
// start from the best point, the sweeps from their own.
const Automatic::Turn Automatic::kRotation[] = {
    // stage, when, budget
    {&Automatic::sweep_while_cheap, always, 20},             // factorisations it may forecast
    {&Automatic::end_of_work, always, 0},                    //
    {&Automatic::paths_from_sweeps, first_and_dear, 1},      // paths
    {&Automatic::arclength_path, first_and_dear, 400},       // factorisations, from the best point
    {&Automatic::paths_from_sweeps, first_and_dear, 2},      // paths
    {&Automatic::interior_points_near, first_and_near, 30},  // steps
    {&Automatic::interior_points, first_and_far_or_cheap, 40},        // steps, from sticking
    {&Automatic::round_off, always, kRoundOffSteps},                  // steps
    {&Automatic::proximal_path_at_best, first_cheap_and_near, 20},    // problems
    {&Automatic::shifted_path, first_and_cheap, 150},                 // steps
    {&Automatic::arclength_path, first_and_cheap, 400},               // factorisations
    {&Automatic::proximal_path_at_best, first_cheap_and_near, 80},    // problems
    {&Automatic::coupling_path, first_and_dear, 150},                 // factorisations
    {&Automatic::directions, unless_first_and_dear, 200},             // iterations
    {&Automatic::interior_points_at_best, first_that_came_near, 30},  // steps
    {&Automatic::proximal_newton, unless_first_and_dear, 12},         // proximal problems
    {&Automatic::no_solution, unless_first_and_dear, 1},              // once in a solve
    {&Automatic::round_off, unless_first_and_dear, kRoundOffSteps},   // steps
    {&Automatic::end_of_work, unless_first_and_dear, 0},              //
    {&Automatic::end_of_round, unless_first_and_dear, 0},             //
    {&Automatic::coupling_path, second_round_once, 150},              // factorisations
    {&Automatic::round_off, every_second_round, kRoundOffSteps},      // steps
    {&Automatic::rescue, every_second_round, 4000},                   // proximal problems a burst
    {&Automatic::end_of_work, every_second_round, 0},                 //
    {&Automatic::patience, every_second_round, 0},                    // rounds that do not halve
};

// Many contacts between few bodies, such as the bricks of a wall: impulses are far from unique, the
// path of interior points turns where contacts that stick and slide admit no solution, and sweeps
// hardly move. By its arclength it goes on, and factorisations by bodies are cheap.
const Automatic::Turn Automatic::kFewBodies[] = {
    {&Automatic::sweep_few_bodies, always, 20},           // factorisations it may forecast
    {&Automatic::end_of_work, always, 0},                 //
    {&Automatic::sticking_point, always, 1},              // factorisation
    {&Automatic::arclength_path_of_most, always, 800},    // factorisations, from the best point
    {&Automatic::shifted_path, always, 1000},             // steps
    {&Automatic::round_off, always, kRoundOffSteps},      // steps
    {&Automatic::end_of_work, always, 0},                 //
    {&Automatic::interior_points, at_a_small_price, 40},  // steps
    {&Automatic::round_off, always, kRoundOffSteps},      // steps
    {&Automatic::proximal_path, always, 4000},            // problems, from the best point
    {&Automatic::end_of_work, always, 0},                 //
};

void Automatic::reset(int contacts, const Options& options, bool proofs) {
  contacts_ = contacts;
  options_ = options;
  proofs_ = proofs;
  pressed_.clear();
  ready_ = looked_for_proof_ = false;
}

void Automatic::prepare(Search& search) {
  if (ready_) return;
  sweeps.reset(contacts_, options_.anderson_depth);
  newton.reset(contacts_);
  admm.reset(contacts_);
  interior.reset(contacts_);
  parts_.reset(contacts_);
  sweep_work_ = search.counts.work;
  held_work_ = 0;
  ready_ = true;
}

template <int N>
Status Automatic::take_turns(Search& search, Rotation& r, const Turn (&turns)[N]) {
  for (const Turn& turn : turns) {
    if (!turn.admitted(search, r)) continue;
    const Status status = (this->*turn.stage)(search, r, turn.budget);
    if (search.solved()) return Status::solved;
    if (status != Status::unsolved) return status;
  }
  return Status::unsolved;
}

Status Automatic::rotate(Search& search, bool last) {
  prepare(search);
  sweeps.start(search.best.data());
  Rotation r;
  r.tenth = r.halved = search.best_error;
  // One round without a gain if the law may be replaced afterwards.
  r.most_patience = last ? 3 : 1;
  for (int i = 0; i < contacts_; ++i) {
    double gamma[2];
    search.system.gamma(i, gamma);
    r.regular = r.regular && std::hypot(gamma[0], gamma[1]) < kStronglyCoupled;
  }
  if (r.regular && !sweep_before_look(search) && interior.order_bodies(search)) {
    const Status status = take_turns(search, r, kFewBodies);
    if (status != Status::unsolved) return status;
    sweeps.start(search.best.data());
  }
  if (search.solved()) return Status::solved;
  for (;; r.first = false) {
    const Status status = take_turns(search, r, kRotation);
    if (status != Status::unsolved) return status;
  }
}

bool Automatic::replace_contacts(Search& search, double eccentricity, bool only_unconverged) {
  System& system = search.system;
  bool any = false;
  z_.resize(search.best.size());
  system.blocks(search.best.data(), z_.data());
  double worst = 0;
  std::vector<double> defect(z_.size());
  for (std::size_t i = 0; i < z_.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const double d = z_[i].v[c] - search.best[i].v[c];
      defect[i] += d * d;
    }
    defect[i] = system.weight(static_cast<int>(i)) * std::sqrt(defect[i]);
    worst = std::max(worst, defect[i]);
  }
  for (int i = 0; i < system.size(); ++i) {
    if (system.problem().local(i).e <= eccentricity || system.replaced(i)) continue;
    if (only_unconverged && defect[at(i)] < 1e-2 * worst) continue;
    system.replace(i);
    any = true;
  }
  return any;
}

Status Automatic::run_part(Search& search, const Packed& start) {
  search.test(start.data(), Method::gauss_seidel);
  return search.solved() ? Status::solved : rotate(search, true);
}

namespace {

// First the strongly coupled contacts that do not converge, then all of them, then coupled ones.
struct Replacement {
  double eccentricity;  // of the contacts, at least
  bool only_unconverged;
  double share;  // of the whole work; 1: all that is left
};
constexpr double kShortShare = 0.025;
constexpr Replacement kReplacements[] = {
    {kStronglyCoupled, true, kShortShare},
    {kStronglyCoupled, false, 1},
    {kCoupled, false, 1},
};

}  // namespace

// From a start of smaller impulses, where it is not round-off of these that is left; what was
// reached before stays where it is the better one.
Status Automatic::rotate_from_soft(Search& search, Status status) {
  constexpr double kLittle = 1e8, kBudget = 20, kShare = 0.25;  // the latter of the work before
  if (search.work_end - search.counts.work <= 0) return status;
  Packed x(search.best.size());
  const double work = search.counts.work;
  const double budget = std::min(kBudget * work, std::max(kLittle, kShare * work));
  if (!soft_.find(search, budget, x)) return status;
  search.test(x.data(), Method::interior_point);
  if (search.solved()) return Status::solved;
  const Packed best = search.best;
  const double error = search.best_error, end = search.work_end;
  search.best_error = std::numeric_limits<double>::infinity();
  search.test(x.data(), Method::interior_point);
  search.work_end = std::min(end, search.counts.work + budget);
  ready_ = false;
  const Status again = rotate(search, true);
  search.work_end = end;
  if (again == Status::solved) return again;
  if (error < search.best_error) {
    search.best = best;
    search.best_error = error;
  }
  return status;
}

Status Automatic::run(Search& search) {
  const Status status = replace_and_rotate(search);
  return status == Status::round_off ? rotate_from_soft(search, status) : status;
}

Status Automatic::replace_and_rotate(Search& search) {
  bool replaceable = false;
  if (search.system.law().replacement && !options_.strict) {
    for (int i = 0; i < contacts_; ++i)
      replaceable = replaceable || search.system.problem().local(i).e > kCoupled;
  }
  if (!replaceable) return rotate(search, true);
  search.work_end = kShortShare * options_.max_work;
  Status status = rotate(search, false);
  for (const Replacement& next : kReplacements) {
    if (status == Status::solved || status == Status::infeasible) break;
    search.work_end = options_.max_work;
    if (next.share < 1)
      search.work_end =
          std::min(search.counts.work + next.share * options_.max_work, search.work_end);
    if (search.exhausted()) return Status::work_limit;
    if (!replace_contacts(search, next.eccentricity, next.only_unconverged)) continue;
    x_ = search.best;
    search.best_error = std::numeric_limits<double>::infinity();
    search.test(x_.data(), Method::gauss_seidel);
    ready_ = false;
    status =
        search.solved() ? Status::solved : rotate(search, &next == std::end(kReplacements) - 1);
  }
  return status;
}

}  // namespace tether::contact::detail
