// Tether: the threads of BodySolver and what each keeps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <tether/contact/body_solver.hpp>
#include <vector>

#include "body_passes/team.hpp"

namespace tether::contact::detail {

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

}  // namespace tether::contact::detail
