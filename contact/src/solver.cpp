// Tether: solver of contact problems: the order of the stages. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/solver.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include "accelerated_sweeps.hpp"
#include "admm.hpp"
#include "convex_relaxation.hpp"
#include "infeasible.hpp"
#include "interior_point.hpp"
#include "proximal_newton.hpp"
#include "refuse.hpp"
#include "solver_words.hpp"

namespace tether::contact {

using detail::at;
using detail::Packed;

namespace {

// Contacts with e above this may have no solution near under maximum_dissipation: the block map
// jumps at b_n = 0 when e > 1.
constexpr double kStronglyCoupled = 0.98;
constexpr double kCoupled = 0.8;

void check(const Options& o) {
  using detail::require;
  require(o.tolerance > 0 && std::isfinite(o.tolerance), "tolerance", o.tolerance,
          "must be finite and > 0");
  require(o.relaxation > 0 && o.relaxation < 2, "relaxation", o.relaxation,
          "must lie between 0 and 2");
  require(o.method != Method::jacobi || o.relaxation <= 1, "relaxation", o.relaxation,
          "must lie in (0, 1] for jacobi");
  require(o.max_sweeps >= 1, "max_sweeps", o.max_sweeps, "must be >= 1");
  require(o.max_work > 0, "max_work", o.max_work, "must be > 0");
  require(o.anderson_depth >= 1 && o.anderson_depth <= detail::Anderson::kMaxDepth,
          "anderson_depth", o.anderson_depth, "must lie in 1 .. 20");
}

}  // namespace

struct Solver::Implementation {
  Options options;
  detail::Search search;
  detail::AcceleratedSweeps sweeps;
  detail::Admm admm;
  detail::ProximalNewton newton;
  detail::InteriorPoint interior;
  Packed x, z, pressed;  // pressed: empty, or the proof that there is no solution
  std::unordered_map<std::uint64_t, PackedVector> memory;
  bool stages_ready = false, looked_for_proof = false;
  double sweep_work = 0;  // of the accelerated sweeps

  void solve(const Problem& problem, const linalg::VectorView* start, Solution& out);
  void prepare_stages(int n);
  Status automatic();
  bool mostly_sticks();
  bool sweep_while_cheap(bool first, bool regular, double kappa);
  Status rotate(bool last);
  Status plain();
  Status give_up();
  bool infeasible();
  bool replace_contacts(double eccentricity, bool only_unconverged);
  void finish(const Problem& problem, Status status, Solution& out);
};

void Solver::Implementation::prepare_stages(int n) {
  if (stages_ready) return;
  sweeps.reset(n, options.anderson_depth);
  newton.reset(n);
  admm.reset(n);
  interior.reset(n);
  sweep_work = search.counts.work;
  stages_ready = true;
}

// What the failed iteration looks like: plain sweeps from the best point that keep moving are a
// cycle (or a wander), those that come to rest above the tolerance are a stall.
Status Solver::Implementation::give_up() {
  if (infeasible()) return Status::infeasible;
  if (search.exhausted()) return Status::work_limit;
  x = search.best;
  double change = 0, size = 0;
  for (int k = 0; k < 100; ++k) {
    z = x;
    search.system.sweep(x.data());
    search.count_sweep();
  }
  for (std::size_t i = 0; i < x.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      change += (x[i].v[c] - z[i].v[c]) * (x[i].v[c] - z[i].v[c]);
      size += x[i].v[c] * x[i].v[c];
    }
  return change > 1e-8 * size ? Status::cycling : Status::stalled;
}

// Looked for once in a solve, where the quick stages have failed.
bool Solver::Implementation::infeasible() {
  if (!looked_for_proof) {
    looked_for_proof = true;
    if (!detail::proves_infeasible(search, pressed)) pressed.clear();
  }
  return !pressed.empty();
}

// Whether the point where everything sticks may be admissible: few contacts that slide or part.
bool Solver::Implementation::mostly_sticks() {
  z.resize(search.best.size());
  search.system.velocities(search.best.data(), z.data());
  const double speed = 1e-3 * search.system.norm_b() / std::sqrt(search.system.size());
  int against = 0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double* r = search.best[i].v;
    const double* w = z[i].v;
    against += w[0] > speed || (r[0] > 0 && std::hypot(w[1], w[2]) > speed);
  }
  return against <= search.system.size() / 4;
}

// Sweeps until their forecast costs more than interior points; true: solved. Half a factorisation of
// sweeps by a guess of the fill, then its exact price; after as much again the point where all stick,
// if a factorisation is cheap or that point looks admissible. The stay before the forecast is asked
// grows with the sweeps that a factorisation costs: forecasts need sweeps, and in large packings
// contacts toggle for hundreds of them before they settle.
bool Solver::Implementation::sweep_while_cheap(bool first, bool regular, double kappa) {
  constexpr double kSteps = 20;         // factorisations of a run of interior points
  constexpr double kLookAround = 0.5;   // factorisations
  constexpr double kStay = 11, kCheap = 30;
  const double begin = search.counts.work;
  const auto sweep = [&](double factorisations, double worth) {
    detail::AcceleratedSweeps::Leave leave;
    leave.other_cost = interior.cost(search);
    leave.least_work = factorisations * leave.other_cost - (search.counts.work - begin);
    leave.worth = worth;
    sweeps.run(search, leave);
    return search.solved() || search.exhausted();
  };
  if (first) {
    if (sweep(kLookAround, 3)) return search.solved();
    interior.order(search);
    if (sweep(kLookAround, 3)) return search.solved();
  }
  const double ratio = interior.cost(search) / search.sweep_cost;
  if (first && regular && (ratio < kCheap || mostly_sticks())) interior.stick(search);
  if (search.solved()) return true;
  // Later as much as the other stages have taken meanwhile.
  const double share = (begin - 2 * sweep_work) / interior.cost(search);
  sweep(std::max(share, kappa * (1 + kStay * ratio / (ratio + kCheap))), kSteps);
  sweep_work += search.counts.work - begin;
  return search.solved();
}

// Stages in rotation (README, section 10).
Status Solver::Implementation::rotate(bool last) {
  constexpr double kRough = 1e-2, kNear = 1e-3, kDear = 30;
  constexpr int kPhases = 2;  // Newton phases before a rescue
  // Rotations without halving the error; one if the law may be replaced afterwards.
  const int most_patience = last ? 3 : 1;
  prepare_stages(search.system.size());
  sweeps.start(search.best.data());
  double kappa = 1, halved = search.best_error, tenth = search.best_error;
  bool first = true, regular = true;
  for (int i = 0; i < search.system.size(); ++i) {
    double gamma[2];
    search.system.gamma(i, gamma);
    regular = regular && std::hypot(gamma[0], gamma[1]) < kStronglyCoupled;
  }
  int phases = 0, bursts = 4, burst = 500, patience = 0, outers = 12;
  for (;;) {
    if (sweep_while_cheap(first, regular, kappa)) return Status::solved;
    if (search.exhausted()) return Status::work_limit;

    const double before = search.best_error;
    // Near an answer interior points need ten steps or so, after a few alternating directions.
    if (first && regular && before < kNear) {
      admm.start(search, search.best.data());
      admm.run(search, 15, true, true);
      if (search.solved()) return Status::solved;
      interior.run_near(search, search.best.data(), 30);
      if (search.solved()) return Status::solved;
    }
    if (first && regular) interior.run(search, 40);
    if (search.solved()) return Status::solved;
    // Where factorisations are dear sweeps go on before stages that take many.
    if (first && regular && interior.cost(search) > kDear * search.sweep_cost) {
      first = false;
      continue;
    }
    admm.start(search, search.best.data());
    admm.run(search, 200, true, true);
    if (search.solved()) return Status::solved;
    if (first && regular && before >= kRough && search.best_error < kRough)
      interior.run_near(search, search.best.data(), 30);
    if (search.solved()) return Status::solved;
    first = false;
    newton.run(search, search.best.data(), 12);
    if (search.solved()) return Status::solved;
    if (infeasible()) return Status::infeasible;
    if (search.exhausted()) return Status::work_limit;
    if (search.best_error < 0.9 * before) sweeps.start(search.best.data());
    kappa = std::min(64.0, 2 * kappa);
    if (search.best_error < 0.1 * tenth) {
      tenth = search.best_error;
      kappa = 1;
    }
    if (++phases < kPhases) continue;

    // Rescue: long plain alternating directions identify the active set, Newton finishes.
    phases = 0;
    for (int k = 0; k < bursts; ++k) {
      if (!admm.started()) admm.start(search, search.best.data());
      if (!admm.started()) break;
      admm.run(search, burst, false, false);
      if (search.solved()) return Status::solved;
      newton.run(search, admm.point(), outers);
      if (search.solved()) return Status::solved;
      if (regular) interior.run_proximal(search, admm.point(), 4000, newton);
      if (search.solved()) return Status::solved;
      if (search.exhausted()) return Status::work_limit;
      burst = std::min(20000, burst + burst / 2);
      outers = std::min(60, outers + 12);
    }
    bursts = std::min(16, bursts + 2);
    sweeps.start(search.best.data());
    if (search.best_error > 0.5 * halved) {
      if (++patience >= most_patience) return give_up();
    } else {
      patience = 0;
      halved = search.best_error;
    }
  }
}

bool Solver::Implementation::replace_contacts(double eccentricity, bool only_unconverged) {
  detail::System& system = search.system;
  bool any = false;
  system.blocks(search.best.data(), z.data());
  double worst = 0;
  std::vector<double> defect(z.size());
  for (std::size_t i = 0; i < z.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const double d = z[i].v[c] - search.best[i].v[c];
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

Status Solver::Implementation::automatic() {
  // Nothing is allocated before a first sweep has failed.
  search.test(x.data(), Method::gauss_seidel);
  if (search.solved()) return Status::solved;
  search.system.sweep(x.data());
  search.count_sweep();
  search.test(x.data(), Method::gauss_seidel);
  if (search.solved()) return Status::solved;
  bool replaceable = false;
  if (options.law == Law::maximum_dissipation && !options.strict) {
    for (int i = 0; i < search.system.size(); ++i)
      replaceable = replaceable || search.system.problem().local(i).e > kCoupled;
  }
  if (replaceable) search.work_end = 0.025 * options.max_work;
  Status status = rotate(!replaceable);
  // First the strongly coupled contacts that do not converge, then all of them, then coupled ones.
  z.resize(x.size());
  for (int attempt = 0; replaceable && attempt < 3 && status != Status::solved && status != Status::infeasible; ++attempt) {
    search.work_end = attempt == 0 ? std::min(search.counts.work + 0.025 * options.max_work, options.max_work)
                                   : options.max_work;
    if (search.exhausted()) return Status::work_limit;
    if (!replace_contacts(attempt < 2 ? kStronglyCoupled : kCoupled, attempt == 0)) continue;
    x = search.best;
    search.best_error = std::numeric_limits<double>::infinity();
    search.test(x.data(), Method::gauss_seidel);
    stages_ready = false;
    status = search.solved() ? Status::solved : rotate(attempt == 2);
  }
  return status;
}

// gauss_seidel, sor, jacobi
Status Solver::Implementation::plain() {
  detail::System& system = search.system;
  const Problem& problem = system.problem();
  double damping = 1;
  if (options.method == Method::jacobi) {
    // Largest eigenvalue of D^-1 A <= most blocks in a row for A = J M^-1 J'.
    int most = 1;
    for (int i = 0; i < system.size(); ++i)
      most = std::max(most, problem.row_start()[at(i + 1)] - problem.row_start()[at(i)]);
    damping = options.relaxation * std::min(1.0, 1.8 / most);
  } else if (options.method == Method::sor) {
    damping = options.relaxation;
  }
  z.resize(x.size());
  search.test(x.data(), options.method);
  int next_test = 1, window = 2000, window_end = 2000;
  double window_error = search.best_error;
  for (int sweep = 1; sweep <= options.max_sweeps && !search.solved(); ++sweep) {
    search.count_sweep();
    if (options.method == Method::gauss_seidel) {
      system.sweep(x.data());
    } else {
      if (options.method == Method::jacobi) {
        system.blocks(x.data(), z.data());
      } else {
        z = x;
        system.sweep(z.data());
      }
      for (std::size_t i = 0; i < x.size(); ++i) {
        for (int c = 0; c < 3; ++c) x[i].v[c] += damping * (z[i].v[c] - x[i].v[c]);
        detail::clip_cone(problem.locals()[i].mu, x[i].v);
      }
    }
    if (sweep >= next_test || sweep == options.max_sweeps) {
      search.test(x.data(), options.method);
      next_test = sweep + 1 + sweep / 8;
    }
    if (search.exhausted()) return Status::work_limit;
    if (sweep >= window_end) {
      if (search.best_error > 0.999 * window_error) return give_up();
      window_error = search.best_error;
      window *= 2;
      window_end = sweep + window;
    }
  }
  return search.solved() ? Status::solved : Status::work_limit;
}

void Solver::Implementation::finish(const Problem& problem, Status status, Solution& out) {
  detail::System& system = search.system;
  const std::size_t n = x.size();
  out.status = status;
  out.error = search.best_error;
  out.counts = search.counts;
  out.history.swap(search.history);
  problem.unpack(search.best, out.impulses);
  detail::velocities(problem, search.best.data(), x.data());
  problem.unpack(x, out.velocities);
  out.infeasible_direction.clear();
  for (const PackedVector& d : pressed)
    out.infeasible_direction.insert(out.infeasible_direction.end(), d.v,
                                    d.v + problem.dimension());
  out.regimes.resize(n);
  out.replaced.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const double* r = search.best[i].v;
    const double reach = problem.locals()[i].mu * r[0];
    const double t2 = r[1] * r[1] + r[2] * r[2];
    out.regimes[i] = !(r[0] > 0) ? Regime::separating
                     : (options.law == Law::frictionless || t2 >= reach * reach * (1 - 1e-9))
                         ? Regime::sliding
                         : Regime::sticking;
    if (system.any_replaced() && system.replaced(static_cast<int>(i))) {
      out.replaced.push_back(static_cast<int>(i));
    }
  }
  out.advice = detail::advice(status, options);
}

void Solver::Implementation::solve(const Problem& problem, const linalg::VectorView* start,
                                   Solution& out) {
  const std::size_t n = static_cast<std::size_t>(problem.contacts());
  search.reset(problem, options,
               options.measure == Measure::automatic ? Measure::fixed_point : options.measure);
  stages_ready = looked_for_proof = false;
  pressed.clear();
  if (start) {
    if (start->size() != problem.b().size())
      detail::refuse_size("start", start->size(), problem.b().size(), "as many as b has");
    detail::require_finite("start", *start);
    x = problem.pack(*start);
  } else {
    x.assign(n, PackedVector());
    if (options.warm_start) {
      for (std::size_t i = 0; i < n; ++i) {
        const auto found = memory.find(problem.id(static_cast<int>(i)));
        if (found != memory.end()) x[i] = found->second;
      }
    }
  }
  search.system.to_own_units(x.data());
  for (std::size_t i = 0; i < n; ++i) {
    if (search.system.at_rest(static_cast<int>(i))) {
      x[i] = {};
    } else if (options.law == Law::frictionless) {
      x[i].v[1] = x[i].v[2] = 0;
      x[i].v[0] = std::max(x[i].v[0], 0.0);
    } else {
      detail::clip_cone(problem.locals()[i].mu, x[i].v);
    }
  }
  Status status = Status::unsolved;
  switch (options.method) {
    case Method::automatic: status = automatic(); break;
    case Method::gauss_seidel:
    case Method::sor:
    case Method::jacobi: status = plain(); break;
    case Method::anderson: {
      search.test(x.data(), Method::anderson);
      if (search.solved()) {
        status = Status::solved;
        break;
      }
      prepare_stages(problem.contacts());
      sweeps.start(x.data());
      detail::AcceleratedSweeps::Leave leave;
      leave.most_sweeps = options.max_sweeps;
      sweeps.run(search, leave);
      status = search.solved() ? Status::solved : give_up();
      break;
    }
    case Method::admm:
      search.test(x.data(), Method::admm);
      prepare_stages(problem.contacts());
      admm.start(search, x.data());
      if (!search.solved()) admm.run(search, options.max_sweeps, true, false);
      status = search.solved() ? Status::solved : give_up();
      break;
    case Method::proximal_newton:
      search.test(x.data(), Method::gauss_seidel);
      prepare_stages(problem.contacts());
      search.system.sweep(x.data());
      search.count_sweep();
      search.test(x.data(), Method::gauss_seidel);
      if (!search.solved()) newton.run(search, x.data(), 60);
      status = search.solved() ? Status::solved : give_up();
      break;
    case Method::interior_point:
      search.test(x.data(), Method::interior_point);
      prepare_stages(problem.contacts());
      if (!search.solved()) interior.run(search, options.max_sweeps);
      status = search.solved() ? Status::solved : give_up();
      break;
    case Method::convex_relaxation: {
      const bool done = detail::solve_convex_relaxation(search, x);
      search.test(x.data(), Method::convex_relaxation);
      status = search.solved() ? Status::solved : done ? Status::relaxed : Status::work_limit;
      break;
    }
  }
  search.system.to_given_units(search.best.data());
  if (options.warm_start) {
    memory.clear();
    for (std::size_t i = 0; i < n; ++i) memory[problem.id(static_cast<int>(i))] = search.best[i];
  }
  finish(problem, status, out);
}

Solver::Solver(const Options& options) : implementation_(new Implementation) {
  check(options);
  implementation_->options = options;
}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

Solution Solver::solve(const Problem& problem) {
  Solution out;
  implementation_->solve(problem, nullptr, out);
  return out;
}
Solution Solver::solve(const Problem& problem, const linalg::VectorView& start) {
  Solution out;
  implementation_->solve(problem, &start, out);
  return out;
}
void Solver::solve(const Problem& problem, Solution& solution) {
  implementation_->solve(problem, nullptr, solution);
}
const Options& Solver::options() const { return implementation_->options; }

}  // namespace tether::contact
