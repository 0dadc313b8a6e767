// Tether: solver of contact problems. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/solver.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <unordered_map>

#include "assembled/island_solves.hpp"
#include "assembled/solver_words.hpp"
#include "assembled/stages/convex_relaxation.hpp"
#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using detail::at;
using detail::Packed;

namespace {

void check(const Options& o) {
  using detail::require;
  static_cast<void>(detail::traits(o.law));  // refuses what is no law
  require(o.method <= Method::convex_relaxation, "method", static_cast<double>(o.method),
          "is none of those of tether::contact::Method");
  require(o.measure <= Measure::fixed_point, "measure", static_cast<double>(o.measure),
          "is none of those of tether::contact::Measure");
  require(o.tolerance > 0 && std::isfinite(o.tolerance), "tolerance", o.tolerance,
          "must be finite and > 0");
  require(o.max_sweeps >= 1, "max_sweeps", o.max_sweeps, "must be >= 1");
  require(o.max_work > 0, "max_work", o.max_work, "must be > 0");
  require(o.enough >= 0, "enough", o.enough, "must be >= 0");
}

}  // namespace

struct Solver::Implementation {
  Options options;
  detail::Search search;
  detail::Automatic stages;
  detail::IslandSolves islands;
  Packed x, z;
  std::unordered_map<std::uint64_t, PackedVector> memory;

  void solve(const Problem& problem, const linalg::VectorView* start, Solution& out);
  void begin(const Problem& problem, const linalg::VectorView* start);
  Status run();
  Status automatic();
  Status plain();
  void to_given_units(Status& status);
  void finish(const Problem& problem, Status status, Solution& out);
};

// The best point. b / A may lie outside of the range of doubles where A and b do not: what
// overflows is no answer, and digits that fall below are lost.
void Solver::Implementation::to_given_units(Status& status) {
  if (!search.system.in_other_units()) return;
  z = search.best;
  search.system.to_given_units(search.best.data());
  bool finite = true;
  for (const PackedVector& p : search.best)
    for (double v : p.v) finite = finite && std::isfinite(v);
  if (!finite) std::fill(search.best.begin(), search.best.end(), PackedVector());
  x = search.best;
  search.system.to_own_units(x.data());
  const auto same = [](const PackedVector& p, const PackedVector& q) {
    return p.v[0] == q.v[0] && p.v[1] == q.v[1] && p.v[2] == q.v[2];
  };
  if (std::equal(x.begin(), x.end(), z.begin(), same)) return;
  z = search.best;
  search.best_error = std::numeric_limits<double>::infinity();
  search.test(x.data(), options.method);
  search.best = z;
  if (status == Status::solved && !search.solved()) status = Status::unsolved;
}

Status Solver::Implementation::automatic() {
  // Nothing is allocated before a first sweep has failed.
  search.test(x.data(), Method::gauss_seidel);
  if (search.solved()) return Status::solved;
  search.system.sweep(x.data());
  search.count_sweep();
  search.test(x.data(), Method::gauss_seidel);
  if (search.solved()) return Status::solved;
  return detail::IslandSolves::serve(search) ? islands.run(search, stages) : stages.run(search);
}

Status Solver::Implementation::plain() {
  search.test(x.data(), options.method);
  int next_test = 1, window = 2000, window_end = 2000;
  double window_error = search.best_error;
  for (int sweep = 1; sweep <= options.max_sweeps && !search.solved(); ++sweep) {
    search.count_sweep();
    search.system.sweep(x.data());
    if (sweep >= next_test || sweep == options.max_sweeps) {
      search.test(x.data(), options.method);
      next_test = sweep + 1 + sweep / 8;
    }
    if (search.exhausted()) return Status::work_limit;
    if (sweep >= window_end) {
      if (search.best_error > 0.999 * window_error) return stages.give_up(search);
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
  if (status != Status::solved && search.measure == Measure::fixed_point) {
    x = search.best;
    system.to_own_units(x.data());
    out.error = std::min(out.error, system.judged_fixed_point(x.data()));
  }
  out.counts = search.counts;
  problem.unpack(search.best, out.impulses);
  if (search.near_round_off())
    detail::exact_velocities(problem, search.best.data(), x.data());
  else
    detail::velocities(problem, search.best.data(), x.data());
  problem.unpack(x, out.velocities);
  out.infeasible_direction.clear();
  for (const PackedVector& d : islands.proof().empty() ? stages.proof() : islands.proof())
    out.infeasible_direction.insert(out.infeasible_direction.end(), d.v, d.v + problem.dimension());
  out.regimes.resize(n);
  out.replaced.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const double* r = search.best[i].v;
    const double reach = system.friction(static_cast<int>(i)) * r[0];
    const double t2 = r[1] * r[1] + r[2] * r[2];
    out.regimes[i] = !(r[0] > 0)                        ? Regime::separating
                     : t2 >= reach * reach * (1 - 1e-9) ? Regime::sliding
                                                        : Regime::sticking;
    if (system.any_replaced() && system.replaced(static_cast<int>(i))) {
      out.replaced.push_back(static_cast<int>(i));
    }
  }
  out.advice = detail::advice(status, options);
}

// x becomes where the solve starts.
void Solver::Implementation::begin(const Problem& problem, const linalg::VectorView* start) {
  const std::size_t n = static_cast<std::size_t>(problem.contacts());
  search.reset(problem, options,
               options.measure == Measure::automatic ? Measure::fixed_point : options.measure);
  stages.reset(problem.contacts(), options);
  islands.reset();
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
    } else if (!search.system.law().friction) {
      x[i].v[1] = x[i].v[2] = 0;
      x[i].v[0] = std::max(x[i].v[0], 0.0);
    } else {
      detail::clip_cone(problem.locals()[i].mu, x[i].v);
    }
  }
}

Status Solver::Implementation::run() {
  switch (options.method) {
    case Method::automatic:
      return automatic();
    case Method::gauss_seidel:
      return plain();
    case Method::anderson: {
      search.test(x.data(), Method::anderson);
      if (search.solved()) return Status::solved;
      stages.prepare();
      stages.sweeps.start(x.data());
      detail::AcceleratedSweeps::Leave leave;
      leave.most_sweeps = options.max_sweeps;
      stages.sweeps.run(search, leave);
      break;
    }
    case Method::proximal_newton:
      search.test(x.data(), Method::gauss_seidel);
      stages.prepare();
      search.system.sweep(x.data());
      search.count_sweep();
      search.test(x.data(), Method::gauss_seidel);
      if (!search.solved()) stages.newton.run(search, x.data(), 60);
      break;
    case Method::interior_point:
      search.test(x.data(), Method::interior_point);
      stages.prepare();
      if (!search.solved()) stages.interior.run(search, options.max_sweeps);
      break;
    case Method::convex_relaxation: {
      const bool done = detail::solve_convex_relaxation(search, x);
      search.test(x.data(), Method::convex_relaxation);
      return search.solved() ? Status::solved : done ? Status::relaxed : Status::work_limit;
    }
  }
  return search.solved() ? Status::solved : stages.give_up(search);
}

void Solver::Implementation::solve(const Problem& problem, const linalg::VectorView* start,
                                   Solution& out) {
  begin(problem, start);
  Status status = run();
  to_given_units(status);
  if (options.warm_start) {
    memory.clear();
    for (std::size_t i = 0; i < x.size(); ++i)
      memory[problem.id(static_cast<int>(i))] = search.best[i];
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
