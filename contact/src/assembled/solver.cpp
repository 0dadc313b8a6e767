// Tether: solver of contact problems. SPDX-License-Identifier: BSD-3-Clause

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tether/contact/solver.hpp>

#include "assembled/automatic.hpp"
#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact::detail {

// Islands are independent, but stages that solve them together couple them. Interior points have
// one step length for all; the round-off of large impulses in one island hides the error of
// another; sweeps go on in all until the slowest has ended. So each island is solved as a problem.
class IslandSolves {
 public:
  // Whether a solve by islands is worth while: the measure is one of islands, and no island holds
  // nearly all contacts (its sweeps would only begin again).
  static bool serve(const Search& search);
  // Solves from search.best. If each island is solved by itself but their union is not, `stages` go
  // on with all of them together.
  Status run(Search& search, Automatic& stages);
  // The normal impulses that prove infeasibility; empty: none are known.
  const Packed& proof() const { return proof_; }
  void reset() { proof_.clear(); }

 private:
  struct Island {
    std::vector<int> contacts;
    Status status = Status::unsolved;
  };
  void solve(Search& search, Island& island, double budget);

  std::vector<Island> islands_;
  Packed x_, proof_;
  Search search_;
  Automatic automatic_;
};

bool IslandSolves::serve(const Search& search) {
  constexpr double kNearlyAll = 0.9;
  if (search.options.measure != Measure::fixed_point || search.system.islands() < 2) return false;
  std::vector<int> size(at(search.system.islands()));
  for (int k : search.system.problem().islands()) ++size[at(k)];
  return *std::max_element(size.begin(), size.end()) <= kNearlyAll * search.system.size();
}

void IslandSolves::solve(Search& search, Island& island, double budget) {
  constexpr double kBlock = 20;  // ns that it takes to take a block out of the problem
  const std::vector<int>& contacts = island.contacts;
  const Problem problem = search.system.problem().part(contacts);
  search.counts.work += kBlock * static_cast<double>(problem.blocks().size());
  Options options = search.options;
  options.max_work = budget;
  search_.reset(problem, options);
  search_.system.belong_to(search.system, contacts);
  Packed start;
  for (int i : contacts) start.push_back(x_[at(i)]);
  search_.system.to_own_units(start.data());
  automatic_.reset(problem.contacts(), options);
  search_.test(start.data(), By::factors);
  island.status = search_.solved() ? Status::solved : automatic_.run(search_);
  search.counts.add(search_.counts);
  search_.system.to_given_units(search_.best.data());
  for (std::size_t r = 0; r < contacts.size(); ++r) {
    x_[at(contacts[r])] = search_.best[r];
    if (search_.system.replaced(static_cast<int>(r))) search.system.replace(contacts[r]);
  }
  if (island.status != Status::infeasible || !proof_.empty()) return;
  proof_.assign(x_.size(), PackedVector());
  const Packed proof = automatic_.proof();
  for (std::size_t r = 0; r < contacts.size(); ++r) proof_[at(contacts[r])] = proof[r];
}

Status IslandSolves::run(Search& search, Automatic& stages) {
  const std::vector<int>& island_of = search.system.problem().islands();
  islands_.assign(at(search.system.islands()), {});
  for (std::size_t i = 0; i < island_of.size(); ++i)
    islands_[at(island_of[i])].contacts.push_back(static_cast<int>(i));
  x_ = search.best;
  // Small islands first, each with an equal part of the work left: larger ones get what these save.
  std::vector<Island*> order;
  for (Island& island : islands_) order.push_back(&island);
  std::stable_sort(order.begin(), order.end(), [](const Island* p, const Island* q) {
    return p->contacts.size() < q->contacts.size();
  });
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double left = search.options.max_work - search.counts.work;
    if (left > 0)
      solve(search, *order[k], left / static_cast<double>(order.size() - k));
    else
      order[k]->status = Status::work_limit;
  }
  // Each island keeps its best point, also if another one is not solved.
  search.best_error = std::numeric_limits<double>::infinity();
  search.test(x_.data(), By::factors);
  if (search.solved()) return Status::solved;
  // The status that says most comes last in this list.
  Status out = Status::solved;
  for (Status s : {Status::unsolved, Status::stalled, Status::cycling, Status::round_off,
                   Status::work_limit, Status::infeasible})
    for (const Island& island : islands_)
      if (island.status == s) out = s;
  // Solved one by one, but not together: rounding of one island exceeds the tolerance of another.
  return out == Status::solved ? stages.run(search) : out;
}

}  // namespace tether::contact::detail

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

const char* name(Measure measure) { return detail::text(measure, {"fixed_point", "natural_map"}); }

const char* name(Status status) {
  return detail::text(status, {"unsolved", "solved", "stalled", "cycling", "work_limit",
                               "round_off", "infeasible"});
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
  detail::velocities(problem, search.near_round_off(), search.best.data(), x.data());
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
