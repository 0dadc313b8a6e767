// Tether: the parts of BodySolver, and what they do together. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <tether/contact/body_solver.hpp>
#include <utility>
#include <vector>

#include "body_passes/given_problem.hpp"
#include "body_passes/island_sweeps.hpp"
#include "body_passes/worker_team.hpp"
#include "graph/contact_graph.hpp"

namespace tether::contact::detail {

// The impulses of the last solve, and of the one before it, so that the last one can be taken back.
// Lists of contacts hardly change between steps: an id is first looked for after the one found
// before. The hash table is built only when that fails. Keeps its storage.
class ImpulseMemory {
 public:
  bool empty() const { return last_.ids.empty(); }
  // Before a run of find().
  void rewind() {
    next_ = 0;
    mask_ = 0;
  }
  const Eigen::Vector3d* find(std::uint64_t id) {
    const std::vector<std::uint64_t>& ids = last_.ids;
    if (ids.empty() || id == kNoId) return nullptr;
    if (next_ < ids.size() && ids[next_] == id) return &last_.impulses[next_++];
    if (mask_ == 0) index();
    for (std::size_t k = hash(id);; k = (k + 1) & mask_) {
      if (table_[k] == kEmpty) return nullptr;
      if (ids[table_[k]] == id) {
        next_ = table_[k] + 1;
        return &last_.impulses[next_ - 1];
      }
    }
  }
  // After a solve: its impulses.
  void keep(const std::vector<PointContact>& contacts, const std::vector<Eigen::Vector3d>& p) {
    std::swap(last_, before_);
    forget();
    for (std::size_t i = 0; i < contacts.size(); ++i) add(contacts[i].id, p[i]);
  }
  void add(std::uint64_t id, const Eigen::Vector3d& impulse) {
    if (id == kNoId) return;
    last_.ids.push_back(id);
    last_.impulses.push_back(impulse);
  }
  void take_back() { std::swap(last_, before_); }
  void scale(double factor) {
    for (Eigen::Vector3d& p : last_.impulses) p *= factor;
  }
  void forget() {
    last_.ids.clear();
    last_.impulses.clear();
  }
  const WarmStart& last() const { return last_; }
  void set(const WarmStart& start) {
    forget();
    for (std::size_t i = 0; i < start.ids.size(); ++i) add(start.ids[i], start.impulses[i]);
  }

 private:
  static constexpr std::uint64_t kNoId = std::numeric_limits<std::uint64_t>::max();
  static constexpr std::uint32_t kEmpty = std::numeric_limits<std::uint32_t>::max();
  std::size_t hash(std::uint64_t id) const {
    id ^= id >> 32;
    id *= 0x9e3779b97f4a7c15u;
    return static_cast<std::size_t>(id >> 29) & mask_;
  }
  void index() {
    std::size_t size = 16;
    while (size < 2 * last_.ids.size()) size *= 2;
    mask_ = size - 1;
    table_.assign(size, kEmpty);
    for (std::size_t i = 0; i < last_.ids.size(); ++i) {
      std::size_t k = hash(last_.ids[i]);
      while (table_[k] != kEmpty) k = (k + 1) & mask_;
      table_[k] = static_cast<std::uint32_t>(i);
    }
  }

  WarmStart last_, before_;
  std::vector<std::uint32_t> table_;
  std::size_t next_ = 0, mask_ = 0;  // 0: not indexed
};

// The same for an assembled problem.
Options assembled_options(const BodyOptions& options);

// Data of one thread.
struct Worker {
  PassScratch scratch;
  // Data of an assembled island.
  std::unique_ptr<Solver> solver;
  Solution solution;
  std::vector<RigidBody> bodies;
  std::vector<ContactRows> contacts;
  std::vector<int> replaced;  // contacts, of all islands
  std::exception_ptr failure;
};

class Workers {
 public:
  // work(worker, team of all threads), on `threads` threads at once; rethrows what one has thrown,
  // and throws std::invalid_argument for the first contact that was refused.
  template <class Work>
  void run(int threads, const Work& work) {
    prepare(threads);
    auto on_thread = [&](int thread) {
      Worker& worker = *workers_[static_cast<std::size_t>(thread)];
      Team all{thread, threads, &team_.barrier, &worker.scratch};
      work(worker, all);
    };
    team_.run(threads, on_thread);
    report();
  }
  // Contacts with another law, in ascending order.
  void replaced(std::vector<int>& out) const {
    out.clear();
    for (const auto& worker : workers_)
      out.insert(out.end(), worker->replaced.begin(), worker->replaced.end());
    std::sort(out.begin(), out.end());
  }

 private:
  void prepare(int threads) {
    while (static_cast<int>(workers_.size()) < threads)
      workers_.push_back(std::make_unique<Worker>());
    for (auto& worker : workers_) {
      worker->replaced.clear();
      worker->failure = nullptr;
      worker->scratch.refused = std::numeric_limits<int>::max();
    }
  }
  void report() const {
    const auto first = std::min_element(
        workers_.begin(), workers_.end(),
        [](const auto& a, const auto& b) { return a->scratch.refused < b->scratch.refused; });
    if ((*first)->scratch.refused < std::numeric_limits<int>::max())
      throw std::invalid_argument("contact " + std::to_string((*first)->scratch.refused) + ": " +
                                  (*first)->scratch.reason);
    for (const auto& worker : workers_)
      if (worker->failure) std::rethrow_exception(worker->failure);
  }

  WorkerTeam team_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

// Islands from this size on are swept by all threads together, others by one thread each.
constexpr int kTogether = 1500;

struct IslandResult {
  Status status = Status::unsolved;
  int sweeps = 0;
  double least_change = 0;  // squares, by the least of the last half of the sweeps
  double error = 0;
  double inverse_scale = 0;  // 1 / velocity scale
  double floor = 0;          // squares of errors up to here are round-off of the bodies' velocities
  double relative(double square) const {
    return square <= floor ? 0 : std::sqrt(square) * inverse_scale;
  }
  bool stale = false;  // velocities hold round-off of much larger impulses to start from
  // Work that a Problem of it may take: sweeps are forecast to need more, or have ended. 0: none.
  double assembly = 0;
  double spent = 0;  // work of assemblies so far
  bool assembled() const { return spent > 0; }
  // How sweeps ended: not yet, without progress or at the limit; the best point was an earlier one,
  // which is unpacked already.
  enum class End { none, at_last_point, at_earlier_point } end = End::none;
  bool saved() const { return end == End::at_earlier_point; }
};

}  // namespace tether::contact::detail

namespace tether::contact {

// Status and error of two parts of a solve together; the error is NaN where one of them is.
Status worse(Status a, Status b);
double worse(double a, double b);

struct BodySolver::Implementation {
  using Island = detail::Island;
  using IslandResult = detail::IslandResult;
  using Kind = detail::Kind;
  using PassResult = detail::PassResult;
  using Team = detail::Team;
  using Vector3d = Eigen::Vector3d;
  using Worker = detail::Worker;
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  BodyOptions options;
  detail::GivenProblem given;    // the caller's bodies and contacts
  detail::ContactGraph graph;    // their islands
  detail::ImpulseMemory memory;  // impulses of earlier solves
  // Impulses of each contact in the memory; empty: none.
  std::vector<const Vector3d*> starts;
  detail::IslandSweeps sweeps;                // impulses and velocities of this solve
  std::vector<IslandResult> results;          // of each island
  detail::Workers workers;                    // threads
  BodySolution* out = nullptr;                // the caller's
  detail::SweepPartners* partners = nullptr;  // other processes: RankTeam

  // A solve, from body_solver.cpp on. Starts from the memory, which the caller renews by keep().
  void solve(const std::vector<RigidBody>& b, const std::vector<PointContact>& c, BodySolution& o);
  void keep(const std::vector<PointContact>& c, const std::vector<Vector3d>& impulses) {
    if (options.warm_start) memory.keep(c, impulses);
  }
  void find_starts();
  void solve_graph();  // given, starts and graph are known
  void solve_islands(int threads);
  bool here(int k) const { return !partners || partners->here(k); }
  bool shared(int k) const { return partners && partners->shared(k); }
  void together(int k, Team& team);
  void alone(int k, Worker& worker);
  void report();

  // block_gauss_seidel.cpp
  struct Iteration;
  void iterate(int k, Team& team);
  IslandResult start(const Island& island, Team& team);
  void save(const Island& island, Team& team);

  // body_assembly.cpp
  void assemble_and_sweep_on(int k, Worker& worker);
  void assemble(int k, Worker& worker);
  Problem assembled(const Island& island, Worker& worker, Eigen::VectorXd& x) const;
  void take(const Island& island, Worker& worker);
  void judge_with_long_sums(int k);
};

}  // namespace tether::contact
