// Tether: sweeps on the velocities of bodies. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_solver.hpp>
#include <tether/contact/ranks.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>

#include "body_passes/body_kernels.hpp"
#include "body_sweeps/implementation.hpp"
#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {
namespace {

using detail::kTogether;

// The status of all is that of the worst island: an order of the enumerators of Status.
constexpr int kSeverity[] = {/*unsolved*/ 4,   /*solved*/ 0,    /*stalled*/ 2,
                             /*cycling*/ 3,
                             /*work_limit*/ 1, /*round_off*/ 2, /*infeasible*/ 5};
int severity(Status s) { return kSeverity[static_cast<int>(s)]; }

void check(const BodyOptions& o) {
  using detail::require;
  static_cast<void>(detail::traits(o.law));  // refuses what is no law
  require(o.tolerance > 0 && std::isfinite(o.tolerance), "tolerance", o.tolerance,
          "must be finite and > 0");
  require(o.max_sweeps >= 1, "max_sweeps", o.max_sweeps, "must be >= 1");
  require(o.min_sweeps >= 0, "min_sweeps", o.min_sweeps, "must be >= 0");
  require(o.threads >= 1 && o.threads <= 256, "threads", o.threads, "must lie in 1 .. 256");
  require(o.max_assembled >= 0, "max_assembled", o.max_assembled, "must be >= 0");
  require(o.max_work > 0, "max_work", o.max_work, "must be > 0");
  require(o.enough >= 0, "enough", o.enough, "must be >= 0");
}

}  // namespace

Status worse(Status a, Status b) { return severity(b) > severity(a) ? b : a; }
double worse(double a, double b) { return b != b || b > a ? b : a; }

// A large island by all threads, or by all processes; islands to be assembled are left to alone().
void BodySolver::Implementation::together(int k, Team& team) {
  const Island& island = graph.islands[at(k)];
  team.partners = shared(k) ? partners : nullptr;
  if (team.partners) team.once([&] { partners->begin(k); });
  sweeps.load(island, team);
  team.meet();
  try {
    iterate(k, team);
  } catch (const std::exception& e) {
    if (team.partners) team.partners->give_up(e.what());
    throw;
  }
  team.meet();
  const IslandResult& r = results[at(k)];
  if (!(r.assembly > 0) && !r.saved()) sweeps.unpack(island, team, *out);
}

void BodySolver::Implementation::alone(int k, Worker& worker) {
  const Island& island = graph.islands[at(k)];
  Team team{0, 1, nullptr, &worker.scratch};
  const IslandResult& r = results[at(k)];
  if (r.sweeps == 0) {
    sweeps.load(island, team);
    iterate(k, team);
  }
  if (r.assembly > 0) return assemble_and_sweep_on(k, worker);
  if (!r.saved()) sweeps.unpack(island, team, *out);
}

void BodySolver::Implementation::solve(const std::vector<RigidBody>& b,
                                       const std::vector<PointContact>& c, BodySolution& o) {
  out = &o;
  given.read(b, c, options.law);
  find_starts();
  if (options.team == nullptr || !options.team->solve(b, c, starts, options, o)) {
    graph.build(static_cast<int>(b.size()), given.first(), given.second(), given.kinds(),
                detail::groups_are_served());
    solve_graph();
  }
}

void BodySolver::Implementation::solve_graph() {
  const std::size_t contacts = given.contacts().size(), bodies = given.bodies().size();
  BodySolution& o = *out;
  sweeps.start(given, graph, options.law);
  results.resize(graph.islands.size());  // assign() would grow without reserve
  std::fill(results.begin(), results.end(), IslandResult{});
  o.impulses.resize(contacts);
  o.regimes.resize(contacts);
  o.velocities.resize(bodies);
  o.angular_velocities.resize(bodies);
  // Few contacts are not worth waking a thread; the bits are the same.
  std::exception_ptr failure;
  try {
    solve_islands(contacts < at(kTogether) ? 1 : options.threads);
  } catch (...) {
    failure = std::current_exception();
  }
  if (partners) partners->finish(failure != nullptr);
  if (failure) std::rethrow_exception(failure);
  report();
}

void BodySolver::Implementation::find_starts() {
  out->warm_started = 0;
  if (!options.warm_start || memory.empty()) return starts.clear();
  starts.resize(given.contacts().size());  // cleared before, it would grow without reserve
  memory.rewind();
  for (std::size_t i = 0; i < starts.size(); ++i) {
    starts[i] = memory.find(given.contacts()[i].id);
    out->warm_started += starts[i] != nullptr;
  }
}

// Large islands by all threads, the others one by one by whoever is free.
void BodySolver::Implementation::solve_islands(int threads) {
  const int islands = static_cast<int>(graph.islands.size());
  const auto large = [&](int k) {
    return shared(k) || (threads > 1 && here(k) && graph.islands[at(k)].contacts >= kTogether);
  };
  std::atomic<int> next{0};
  workers.run(threads, [&](Worker& worker, Team& all) {
    for (int k = 0; k < islands; ++k) {
      if (large(k)) together(k, all);
    }
    all.meet();
    constexpr int kBatch = 16;
    try {
      for (int k = next.fetch_add(kBatch); k < islands; k = next.fetch_add(kBatch)) {
        for (int i = k; i < std::min(k + kBatch, islands); ++i) {
          if (here(i) && !shared(i) && (!large(i) || results[at(i)].assembly > 0)) alone(i, worker);
        }
      }
    } catch (...) {
      worker.failure = std::current_exception();
    }
  });
}

// Everything that is about more than one island.
void BodySolver::Implementation::report() {
  for (std::size_t k = 0; k < given.bodies().size(); ++k) {
    if (graph.slot[k] >= 0) continue;
    out->velocities[k] = given.bodies()[k].velocity;
    out->angular_velocities[k] = given.bodies()[k].angular_velocity;
  }
  out->status = Status::solved;
  out->error = 0;
  out->sweeps = out->colours = out->assembled_islands = out->failed_islands = 0;
  out->islands = static_cast<int>(results.size());
  for (std::size_t k = 0; k < results.size(); ++k) {
    const IslandResult& r = results[k];
    if (partners && !partners->reports(static_cast<int>(k))) continue;
    out->error = worse(out->error, r.error);
    out->sweeps = std::max(out->sweeps, r.sweeps);
    out->colours =
        std::max(out->colours, graph.islands[k].colour_end - graph.islands[k].colour_begin);
    out->assembled_islands += r.assembled();
    if (r.status == Status::solved) continue;
    ++out->failed_islands;
    out->status = worse(out->status, r.status);
  }
  workers.replaced(out->replaced);
  out->spheres = !sweeps.has_general();
}

BodySolver::BodySolver(const BodyOptions& options) : implementation_(new Implementation) {
  set_options(options);
}
BodySolver::~BodySolver() = default;
BodySolver::BodySolver(BodySolver&&) noexcept = default;
BodySolver& BodySolver::operator=(BodySolver&&) noexcept = default;

const BodyOptions& BodySolver::options() const { return implementation_->options; }
void BodySolver::set_options(const BodyOptions& options) {
  check(options);
  implementation_->options = options;
}
void BodySolver::scale_warm_start(double factor) {
  if (!(factor >= 0) || !std::isfinite(factor)) {
    detail::refuse("factor", factor, "must be finite and >= 0");
  }
  implementation_->memory.scale(factor);
}
void BodySolver::take_back() { implementation_->memory.take_back(); }
void BodySolver::forget() { implementation_->memory.forget(); }
WarmStart BodySolver::warm_start() const { return implementation_->memory.last(); }

void BodySolver::set_warm_start(const WarmStart& start) {
  if (start.ids.size() != start.impulses.size())
    throw std::invalid_argument("warm start: " + std::to_string(start.ids.size()) + " ids, but " +
                                std::to_string(start.impulses.size()) + " impulses");
  implementation_->memory.set(start);
}

BodySolution BodySolver::solve(const std::vector<RigidBody>& bodies,
                               const std::vector<PointContact>& contacts) {
  BodySolution out;
  solve(bodies, contacts, out);
  return out;
}

void BodySolver::solve(const std::vector<RigidBody>& bodies,
                       const std::vector<PointContact>& contacts, BodySolution& solution) {
  implementation_->solve(bodies, contacts, solution);
  implementation_->keep(contacts, solution.impulses);
}

std::vector<ContactRows> to_contacts(const std::vector<PointContact>& contacts) {
  std::vector<ContactRows> out;
  for (const PointContact& c : contacts) {
    out.push_back(ContactRows::at_point(c.first, c.second, c.r1, c.r2, c.normal, c.mu));
    out.back().bias = tangent_frame(c.normal) * c.slip;
    out.back().bias[0] += c.bias;
  }
  return out;
}

}  // namespace tether::contact
