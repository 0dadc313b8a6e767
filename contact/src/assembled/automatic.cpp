// Tether: Method::automatic: stages by their prices. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/automatic.hpp"

#include <algorithm>
#include <cmath>

#include "assembled/infeasible.hpp"

namespace tether::contact::detail {
namespace {

// Contacts with e above this may have no solution near under maximum_dissipation: the block map
// jumps at b_n = 0 when e > 1.
constexpr double kStronglyCoupled = 0.98;
constexpr double kCoupled = 0.8;
// Sweeps that a factorisation costs, from which on sweeps go on before stages that take many of
// them.
constexpr double kDear = 30;
// Below this error interior points start near the best point.
constexpr double kNear = 1e-3, kRough = 1e-2;

// unsolved: neither solved nor out of work.
Status ended(const Search& search) {
  if (search.solved()) return Status::solved;
  return search.exhausted() ? Status::work_limit : Status::unsolved;
}

}  // namespace

// Where a rotation stands.
struct Automatic::Rotation {
  bool first = true;
  bool regular = true;  // no strongly coupled contact: the interior points' slip is differentiable
  double kappa = 1;     // sweeps in factorisations, beside what is asked for where those are dear
  double tenth = 0, halved = 0;  // errors at the last gain of ten and of two
  int phases = 0, bursts = 4, burst = 500, outers = 12, patience = 0;
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
  ready_ = true;
}

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
bool Automatic::at_round_off(Search& search) {
  constexpr double kGain = 0.7;
  constexpr int kSteps = 8;
  while (search.explained_by_round_off() && !search.solved()) {
    const double before = search.best_error;
    prepare(search);
    interior.run_near(search, search.best.data(), kSteps);
    if (search.best_error > kGain * before) return true;
    if (search.exhausted()) return false;
  }
  return false;
}

// Plain sweeps from the best point that keep moving are a cycle (or a wander), those that come to
// rest above the tolerance are a stall.
Status Automatic::give_up(Search& search) {
  if (infeasible(search)) return Status::infeasible;
  if (at_round_off(search)) return Status::round_off;
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
  const double begin = search.counts.work;
  for (int look = 0; look < 2; ++look) {
    AcceleratedSweeps::Leave leave;
    const double price = interior.cost(search);
    leave.price = kWorth * price;
    leave.least_work = kLookAround * price - (search.counts.work - begin);
    if (look == 0 && interior.cost_by_width(search) > kDear * search.sweep_cost)
      leave.least_work = std::max(leave.least_work, interior.order_cost(search) / kSmallPart);
    sweeps.run(search, leave);
    if (search.solved() || search.exhausted()) return search.solved();
    if (look == 0) interior.order(search);
  }
  if (r.regular && (interior.cost(search) < kDear * search.sweep_cost || mostly_sticks(search)))
    interior.stick(search);
  return search.solved();
}

// Sweeps in turn with solves of the parts where they do not settle, until so much work is done. A
// round that does not halve the error, once the sweeps have spread it, is followed by twice as many
// sweeps: those that need no help are soon left alone.
bool Automatic::sweep_and_solve_parts(Search& search, double until) {
  constexpr double kShare = 0.5, kCheap = 0.1, kPartShare = 0.1;      // of the work before
  constexpr double kBetween = 50, kMostBetween = 400, kGrowth = 1.4;  // sweeps
  const double begin = search.counts.work;
  double in_parts = 0, halved = search.best_error, between = kBetween;
  while (!search.solved() && !search.exhausted() && search.counts.work < until) {
    AcceleratedSweeps::Leave leave;
    leave.price = search.counts.work;
    leave.least_work = between * search.sweep_cost;
    leave.most_work = until - search.counts.work;
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
    if (!changed) continue;
    search.test(x_.data(), Method::anderson);
    sweeps.replace(x_.data());
  }
  return search.solved();
}

// Sweeps until their forecast costs more than interior points; true: solved. The stay before the
// forecast is asked grows with the sweeps that a factorisation costs: in large packings contacts
// toggle for hundreds of sweeps before they settle, and interior points do not serve them sooner.
bool Automatic::sweep_while_cheap(Search& search, Rotation& r) {
  constexpr double kSteps = 20;  // factorisations of a run of interior points
  constexpr double kStay = 40;
  const double begin = search.counts.work;
  if (r.first && (sweep_first(search, r) || search.exhausted())) return search.solved();
  const double price = interior.cost(search);
  const double ratio = price / search.sweep_cost;
  // Later as much as the other stages have taken meanwhile.
  const double share = begin - 2 * sweep_work_;
  if (ratio > kDear) {
    sweep_and_solve_parts(search, begin + std::max(share, r.kappa * kStay * price));
  } else {
    constexpr double kShortStay = 11;
    AcceleratedSweeps::Leave leave;
    leave.price = kSteps * price;
    leave.least_work =
        std::max(share, r.kappa * price * (1 + kShortStay * ratio / (ratio + kDear))) -
        (search.counts.work - begin);
    sweeps.run(search, leave);
  }
  sweep_work_ += search.counts.work - begin;
  return search.solved();
}

bool Automatic::near_the_best(Search& search) {
  interior.run_near(search, search.best.data(), 30);
  return search.solved();
}

// Near an answer interior points need ten steps or so, after a few alternating directions; else
// they start from sticking. Where that is dear, one of the two.
bool Automatic::interior_points(Search& search, const Rotation& r, double before) {
  if (!r.first || !r.regular) return false;
  const bool dear = interior.cost(search) > kDear * search.sweep_cost;
  if (before < kNear) {
    admm.start(search, search.best.data());
    admm.run(search, 15, true, true);
    if (search.solved() || near_the_best(search)) return true;
    if (dear) return false;
  }
  interior.run(search, 40);
  return search.solved();
}

// Long plain alternating directions identify the active set, Newton finishes.
bool Automatic::rescue(Search& search, Rotation& r) {
  r.phases = 0;
  for (int k = 0; k < r.bursts && !search.exhausted(); ++k) {
    if (!admm.started()) admm.start(search, search.best.data());
    if (!admm.started()) break;
    admm.run(search, r.burst, false, false);
    if (search.solved()) return true;
    newton.run(search, admm.point(), r.outers);
    if (search.solved()) return true;
    if (r.regular) interior.run_proximal(search, admm.point(), 4000, newton);
    if (search.solved()) return true;
    r.burst = std::min(20000, r.burst + r.burst / 2);
    r.outers = std::min(60, r.outers + 12);
  }
  r.bursts = std::min(16, r.bursts + 2);
  return false;
}

// Many contacts between few bodies, such as the bricks of a wall: impulses are far from unique, the
// path of interior points ends where contacts that stick and slide admit no solution, and sweeps
// hardly move. The proximal problems have a path, and factorisations by bodies are cheap.
Status Automatic::few_bodies(Search& search) {
  // Sweeps as long as they forecast less than a run of interior points: one body on hundreds of
  // points, which slides on all of them, is solved by them.
  constexpr double kStay = 5, kSteps = 20;  // factorisations
  AcceleratedSweeps::Leave leave;
  leave.price = kSteps * interior.cost(search);
  leave.least_work = kStay * interior.cost(search);
  sweeps.run(search, leave);
  if (search.solved() || search.exhausted()) return ended(search);
  interior.stick(search);
  if (search.solved()) return Status::solved;
  constexpr int kRun = 40;
  constexpr double kShare = 0.25;
  // Where their path ends is no better start than where the sweeps were.
  x_ = search.best;
  if (kRun * interior.cost(search) < kShare * (search.work_end - search.counts.work))
    interior.run(search, kRun);
  if (at_round_off(search)) return Status::round_off;
  if (!search.solved()) interior.run_proximal(search, x_.data(), 4000, newton);
  return ended(search);
}

// Stages in rotation (README, section 10).
Status Automatic::rotate(Search& search, bool last) {
  constexpr int kPhases = 2;  // Newton phases before a rescue
  // Rotations without halving the error; one if the law may be replaced afterwards.
  const int most_patience = last ? 3 : 1;
  prepare(search);
  sweeps.start(search.best.data());
  Rotation r;
  r.tenth = r.halved = search.best_error;
  for (int i = 0; i < contacts_; ++i) {
    double gamma[2];
    search.system.gamma(i, gamma);
    r.regular = r.regular && std::hypot(gamma[0], gamma[1]) < kStronglyCoupled;
  }
  if (r.regular && interior.order_bodies(search)) {
    const Status status = few_bodies(search);
    if (status == Status::round_off && infeasible(search)) return Status::infeasible;
    if (status != Status::unsolved) return status;
    sweeps.start(search.best.data());
  }
  for (;;) {
    if (sweep_while_cheap(search, r)) return Status::solved;
    if (search.exhausted()) return Status::work_limit;

    const double before = search.best_error;
    if (interior_points(search, r, before)) return Status::solved;
    if (at_round_off(search)) return infeasible(search) ? Status::infeasible : Status::round_off;
    if (search.solved()) return Status::solved;
    // Where factorisations are dear sweeps go on before stages that take many.
    if (r.first && r.regular && interior.cost(search) > kDear * search.sweep_cost) {
      r.first = false;
      continue;
    }
    admm.start(search, search.best.data());
    admm.run(search, 200, true, true);
    if (search.solved()) return Status::solved;
    if (r.first && r.regular && before >= kRough && search.best_error < kRough &&
        near_the_best(search))
      return Status::solved;
    r.first = false;
    newton.run(search, search.best.data(), 12);
    if (search.solved()) return Status::solved;
    if (infeasible(search)) return Status::infeasible;
    if (at_round_off(search)) return infeasible(search) ? Status::infeasible : Status::round_off;
    if (search.solved()) return Status::solved;
    if (search.exhausted()) return Status::work_limit;
    if (search.best_error < 0.9 * before) sweeps.start(search.best.data());
    r.kappa = std::min(64.0, 2 * r.kappa);
    if (search.best_error < 0.1 * r.tenth) {
      r.tenth = search.best_error;
      r.kappa = 1;
    }
    if (++r.phases < kPhases) continue;

    if (rescue(search, r)) return Status::solved;
    if (search.exhausted()) return Status::work_limit;
    sweeps.start(search.best.data());
    if (search.best_error > 0.5 * r.halved) {
      if (++r.patience >= most_patience) return give_up(search);
    } else {
      r.patience = 0;
      r.halved = search.best_error;
    }
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

Status Automatic::run(Search& search) {
  bool replaceable = false;
  if (search.system.law().replacement && !options_.strict) {
    for (int i = 0; i < contacts_; ++i)
      replaceable = replaceable || search.system.problem().local(i).e > kCoupled;
  }
  if (replaceable) search.work_end = 0.025 * options_.max_work;
  Status status = rotate(search, !replaceable);
  // First the strongly coupled contacts that do not converge, then all of them, then coupled ones.
  for (int attempt = 0; replaceable && attempt < 3; ++attempt) {
    if (status == Status::solved || status == Status::infeasible) break;
    search.work_end =
        attempt == 0 ? std::min(search.counts.work + 0.025 * options_.max_work, options_.max_work)
                     : options_.max_work;
    if (search.exhausted()) return Status::work_limit;
    if (!replace_contacts(search, attempt < 2 ? kStronglyCoupled : kCoupled, attempt == 0))
      continue;
    x_ = search.best;
    search.best_error = std::numeric_limits<double>::infinity();
    search.test(x_.data(), Method::gauss_seidel);
    ready_ = false;
    status = search.solved() ? Status::solved : rotate(search, attempt == 2);
  }
  return status;
}

}  // namespace tether::contact::detail
