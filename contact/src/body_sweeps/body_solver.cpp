// Tether: sweeps on the velocities of bodies. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_solver.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>

#include "body_sweeps/body_parts.hpp"
#include "problem/contact_side.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {
namespace {

// Islands from this size on are swept by all threads together, others by one thread each.
constexpr int kTogether = 1500;

// The status of all is that of the worst island.
int severity(Status s) {
  switch (s) {
    case Status::solved:
      return 0;
    case Status::work_limit:
      return 1;
    case Status::round_off:
    case Status::stalled:
      return 2;
    case Status::cycling:
      return 3;
    case Status::infeasible:
      return 5;
    default:
      return 4;
  }
}

void check(const BodyOptions& o) {
  using detail::require;
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

void BodySolver::Implementation::unpack(const Island& island, const Team& team) {
  int turn = 0;
  pass(island, team, turn, [&](int chunk) { return unpack(chunk), PassResult(); });
  const int begin = island.body_begin, end = island.body_end;
  for (int s = team.from(begin, end); s < team.to(begin, end); ++s) {
    const int b = graph.body[at(s)];
    out->velocities[at(b)] = detail::load(state[at(s)].v);
    out->angular_velocities[at(b)] = detail::load(state[at(s)].w);
  }
}

// A large island by all threads; islands to be assembled are left to alone().
void BodySolver::Implementation::together(int k, const Team& team) {
  const Island& island = graph.islands[at(k)];
  const int begin = island.body_begin, end = island.body_end;
  team.worker->nowhere = {};
  for (int s = team.from(begin, end); s < team.to(begin, end); ++s) load_body(s);
  team.meet();
  iterate(k, team);
  team.meet();
  if (!assemblable(k) && !results[at(k)].saved) unpack(island, team);
}

void BodySolver::Implementation::alone(int k, Worker& worker) {
  const Island& island = graph.islands[at(k)];
  const Team team{0, 1, nullptr, &worker};
  worker.nowhere = {};
  if (results[at(k)].sweeps == 0) {
    for (int s = island.body_begin; s < island.body_end; ++s) load_body(s);
    iterate(k, team);
  }
  if (assemblable(k)) assemble(k, worker);
  if (!results[at(k)].saved) unpack(island, team);
}

void BodySolver::Implementation::solve(const std::vector<RigidBody>& b,
                                       const std::vector<PointContact>& c, BodySolution& o) {
  bodies = &b;
  contacts = &c;
  out = &o;
  read_bodies();
  read_contacts();
  find_starts();
  graph.build(static_cast<int>(b.size()), first, second, kind, detail::groups_are_served());

  const Chunk& end = graph.chunks.back();
  const auto total = [&](Kind k) { return at(end.begin[static_cast<int>(k)]); };
  general4.resize(total(Kind::general4) / 4);
  spheres4.resize(total(Kind::sphere4) / 4);
  general.resize(total(Kind::general));
  spheres.resize(total(Kind::sphere));
  smooth.resize(total(Kind::smooth));
  state.resize(graph.body.size());
  inertia.resize(graph.body.size());
  for (std::vector<PassResult>& sums : chunk_sum) sums.resize(graph.chunks.size());
  results.resize(graph.islands.size());  // assign() would grow without reserve
  std::fill(results.begin(), results.end(), IslandResult{});
  previous_impulse.resize(3 * c.size());
  previous_velocity.resize(6 * graph.body.size());
  o.impulses.resize(c.size());
  o.regimes.resize(c.size());
  o.velocities.resize(b.size());
  o.angular_velocities.resize(b.size());

  // Few contacts are not worth waking a thread; the bits are the same.
  const int threads = c.size() < at(kTogether) ? 1 : options.threads;
  while (static_cast<int>(workers.size()) < threads) workers.push_back(std::make_unique<Worker>());
  for (auto& worker : workers) {
    worker->replaced.clear();
    worker->failure = nullptr;
    worker->bad_contact = std::numeric_limits<int>::max();
  }
  const int islands = static_cast<int>(graph.islands.size());
  const auto large = [&](int k) {
    return threads > 1 && graph.islands[at(k)].contacts >= kTogether;
  };
  std::atomic<int> next{0};
  auto work = [&](int thread) {
    Worker& worker = *workers[at(thread)];
    const Team all{thread, threads, &threads_.barrier, &worker};
    for (int k = 0; k < islands; ++k) {
      if (large(k)) together(k, all);
    }
    all.meet();
    // The others one by one, whoever is free.
    constexpr int kBatch = 16;
    try {
      for (int k = next.fetch_add(kBatch); k < islands; k = next.fetch_add(kBatch)) {
        for (int i = k; i < std::min(k + kBatch, islands); ++i) {
          if (!large(i) || assemblable(i)) alone(i, worker);
        }
      }
    } catch (...) {
      worker.failure = std::current_exception();
    }
  };
  threads_.run(threads, work);
  finish();
}

// Everything that is about more than one island.
void BodySolver::Implementation::finish() {
  int bad = std::numeric_limits<int>::max();
  const Worker* by = nullptr;
  for (const auto& worker : workers) {
    if (worker->bad_contact >= bad) continue;
    bad = worker->bad_contact;
    by = worker.get();
  }
  if (by) throw std::invalid_argument("contact " + std::to_string(bad) + ": " + by->bad_reason);
  for (const auto& worker : workers) {
    if (worker->failure) std::rethrow_exception(worker->failure);
  }

  for (std::size_t k = 0; k < bodies->size(); ++k) {
    if (graph.slot[k] >= 0) continue;
    out->velocities[k] = (*bodies)[k].velocity;
    out->angular_velocities[k] = (*bodies)[k].angular_velocity;
  }
  out->status = Status::solved;
  out->error = 0;
  out->sweeps = out->colours = out->assembled_islands = out->failed_islands = 0;
  out->islands = static_cast<int>(results.size());
  for (std::size_t k = 0; k < results.size(); ++k) {
    const IslandResult& r = results[k];
    out->error = std::max(out->error, r.error);
    out->sweeps = std::max(out->sweeps, r.sweeps);
    out->colours =
        std::max(out->colours, graph.islands[k].colour_end - graph.islands[k].colour_begin);
    out->assembled_islands += r.assembled;
    if (r.status == Status::solved) continue;
    ++out->failed_islands;
    if (severity(r.status) > severity(out->status)) out->status = r.status;
  }
  out->replaced.clear();
  for (const auto& worker : workers) {
    out->replaced.insert(out->replaced.end(), worker->replaced.begin(), worker->replaced.end());
  }
  std::sort(out->replaced.begin(), out->replaced.end());
  out->spheres = general.empty() && general4.empty();

  if (options.warm_start) {
    std::swap(memory, memory_before);
    memory.clear();
    for (std::size_t i = 0; i < contacts->size(); ++i)
      memory.add((*contacts)[i].id, out->impulses[i]);
  }
  const auto bytes = [](const auto&... list) {
    return (... + (list.capacity() * sizeof(list[0])));
  };
  out->bytes = graph.contact_bytes() + memory.bytes() +
               bytes(first, second, kind, turned, start, general4, spheres4, general, spheres,
                     smooth, chunk_sum[0], chunk_sum[1], results, previous_impulse);
  out->body_bytes =
      graph.body_bytes() + bytes(body_kind, state, inertia, fixed_slot, fixed, previous_velocity);
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
void BodySolver::take_back() { std::swap(implementation_->memory, implementation_->memory_before); }
void BodySolver::forget() { implementation_->memory.clear(); }
WarmStart BodySolver::warm_start() const {
  return {implementation_->memory.ids(), implementation_->memory.impulses()};
}
void BodySolver::set_warm_start(const WarmStart& start) {
  if (start.ids.size() != start.impulses.size())
    throw std::invalid_argument("warm start: " + std::to_string(start.ids.size()) + " ids, but " +
                                std::to_string(start.impulses.size()) + " impulses");
  detail::ImpulseMemory& memory = implementation_->memory;
  memory.clear();
  for (std::size_t i = 0; i < start.ids.size(); ++i) memory.add(start.ids[i], start.impulses[i]);
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
}

std::vector<Body> to_bodies(const std::vector<RigidBody>& bodies) {
  std::vector<Body> out(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    out[k].inverse_mass.topLeftCorner<3, 3>() =
        bodies[k].inverse_mass * Eigen::Matrix3d::Identity();
    out[k].inverse_mass.bottomRightCorner<3, 3>() = bodies[k].inverse_inertia;
    out[k].velocity << bodies[k].velocity, bodies[k].angular_velocity;
  }
  return out;
}

std::vector<BodyContact> to_contacts(const std::vector<PointContact>& contacts) {
  std::vector<BodyContact> out;
  for (const PointContact& c : contacts) {
    out.push_back(BodyContact::at_point(c.first, c.second, c.r1, c.r2, c.normal, c.mu));
    out.back().bias[0] = c.bias;
  }
  return out;
}

}  // namespace tether::contact
