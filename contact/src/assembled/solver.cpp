// Tether: solver of contact problems. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/solver.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "assembled/island_solves.hpp"
#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using detail::at;
using detail::By;
using detail::Packed;

namespace {

void check(const Options& o) {
  using detail::require;
  static_cast<void>(detail::traits(o.law));  // refuses what is no law
  require(o.measure <= Measure::natural_map, "measure", static_cast<double>(o.measure),
          "is none of those of tether::contact::Measure");
  require(o.tolerance > 0 && std::isfinite(o.tolerance), "tolerance", o.tolerance,
          "must be finite and > 0");
  require(o.max_work > 0, "max_work", o.max_work, "must be > 0");
  require(o.enough >= 0, "enough", o.enough, "must be >= 0");
}

const char* advice(Status status, const Options& options) {
  switch (status) {
    case Status::solved:
      return "";
    case Status::cycling:
      return detail::kernels(options.law).replacement != nullptr && options.strict
                 ? "no fixed point was found; try strict = false, or Law::coulomb"
                 : "no fixed point was found; try another start or a shorter time step";
    case Status::stalled:
      return "no further progress: round-off or ill-conditioned data, or no solution of the law is "
             "near; error is what was reached; try a larger tolerance";
    case Status::round_off:
      return "error is what rounding leaves of A x - b at impulses of this size: the tolerance "
             "cannot "
             "be reached; use a larger one, or smaller ratios of mass";
    case Status::work_limit:
      return "error is what was reached; raise max_work";
    case Status::infeasible:
      return "bodies are pressed between contacts that close and cannot yield "
             "(infeasible_direction): "
             "lower the closing velocities, or let one of the contacts go";
    case Status::unsolved:
      return "the impulses lie outside of the range of doubles: use other units";
  }
  return "";
}

}  // namespace

const char* name(Measure measure) {
  switch (measure) {
    case Measure::fixed_point:
      return "fixed_point";
    case Measure::natural_map:
      return "natural_map";
  }
  return "?";
}

const char* name(Status status) {
  switch (status) {
    case Status::unsolved:
      return "unsolved";
    case Status::solved:
      return "solved";
    case Status::stalled:
      return "stalled";
    case Status::cycling:
      return "cycling";
    case Status::work_limit:
      return "work_limit";
    case Status::round_off:
      return "round_off";
    case Status::infeasible:
      return "infeasible";
  }
  return "?";
}

struct Solver::Implementation {
  Options options;
  detail::Search search;
  detail::Automatic stages;
  detail::IslandSolves islands;
  Packed x, z;

  void solve(const Problem& problem, const linalg::VectorView* start, Solution& out);
  void begin(const Problem& problem, const linalg::VectorView* start);
  Status run();
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
  search.test(x.data(), By::sweeps);
  search.best = z;
  if (status == Status::solved && !search.solved()) status = Status::unsolved;
}

Status Solver::Implementation::run() {
  // Nothing is allocated before a first sweep has failed.
  search.test(x.data(), By::sweeps);
  if (search.solved()) return Status::solved;
  search.system.sweep(x.data());
  search.count_sweep();
  search.test(x.data(), By::sweeps);
  if (search.solved()) return Status::solved;
  return detail::IslandSolves::serve(search) ? islands.run(search, stages) : stages.run(search);
}

void Solver::Implementation::finish(const Problem& problem, Status status, Solution& out) {
  detail::System& system = search.system;
  const std::size_t n = x.size();
  out.status = status;
  out.error = search.best_error;
  if (status != Status::solved && options.measure == Measure::fixed_point) {
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
  out.advice = advice(status, options);
}

// x becomes where the solve starts.
void Solver::Implementation::begin(const Problem& problem, const linalg::VectorView* start) {
  const std::size_t n = static_cast<std::size_t>(problem.contacts());
  search.reset(problem, options);
  stages.reset(problem.contacts(), options);
  islands.reset();
  if (start) {
    if (start->size() != problem.b().size())
      detail::refuse_size("start", start->size(), problem.b().size(), "as many as b has");
    detail::require_finite("start", *start);
    x = problem.pack(*start);
  } else {
    x.assign(n, PackedVector());
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

void Solver::Implementation::solve(const Problem& problem, const linalg::VectorView* start,
                                   Solution& out) {
  begin(problem, start);
  Status status = run();
  to_given_units(status);
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
