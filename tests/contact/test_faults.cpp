// Tether: memory that ends at the n-th allocation of a contact solve or of a step.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <new>
#include <stdexcept>
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "linalg/allocations.hpp"
#include "stepping_scenes.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using namespace tether::test;
namespace stepping = stepping_scenes;
namespace tc = tether::contact;

namespace {

constexpr int kPositions = 60;

/// Lets the allocations of `job` fail one at a time, about kPositions of them: each time it must
/// end with std::bad_alloc, or not have noticed, and leave no block behind. Returns how many
/// failed.
template <class Job>
int fail_each_allocation(const Job& job) {
  job();  // what is made once for the whole program
  const long before = allocations();
  job();
  const long count = allocations() - before;
  int failures = 0;
  for (long n = 0; n < count; n += std::max(1L, count / kPositions)) {
    const long blocks = blocks_alive();
    bool ended = false, other = false;
    fail_allocation(n);
    try {
      job();
    } catch (const std::bad_alloc&) {
      ended = true;
    } catch (...) {
      other = true;
    }
    fail_allocation(-1);
    const long left = blocks_alive() - blocks;
    INFO("allocation " << n << " of " << count << (ended ? ", ended" : ", went on"));
    CHECK_FALSE(other);
    // Eigen's minimum degree ordering goes on without a block that it could not reallocate, and
    // forgets the old one.
    CHECK(left <= (ended ? 0 : 1));
    failures += ended;
  }
  return failures;
}

}  // namespace

TEST_CASE(
    "faults: memory that ends in a solve is std::bad_alloc, leaks nothing, and is forgotten") {
  random::Generator g(3);
  const Problem problem = random::cluster(g, 0.8, 6, 14).problem();
  for (const Law law : {Law::coulomb, Law::maximum_dissipation}) {
    Options options;
    options.law = law;
    const Eigen::VectorXd wanted = Solver(options).solve(problem).impulses;
    Solver used(options);
    CHECK(fail_each_allocation([&] { Solver(options).solve(problem); }) > 10);
    for (long n = 0; n < 40; n += 3) {
      fail_allocation(n);
      try {
        used.solve(problem);
      } catch (const std::bad_alloc&) {
      }
      fail_allocation(-1);
      CHECK(used.solve(problem).impulses == wanted);
    }
  }
}

TEST_CASE("faults: memory that ends in a solve by bodies, with one thread and with two") {
  for (const int threads : {1, 2}) {
    // 400 boxes: 1600 contacts, enough for two threads to sweep an island together.
    const random::RigidAssembly stack = random::rigid_stack(threads == 1 ? 5 : 400, 1);
    BodyOptions options;
    options.threads = threads;
    options.max_sweeps = 3;
    options.max_assembled = threads == 1 ? 1000 : 0;
    CHECK(fail_each_allocation([&] { BodySolver(options).solve(stack.bodies, stack.contacts); }) >
          10);
    // A solver that has thrown solves the next problem.
    const random::RigidAssembly small = random::rigid_stack(5, 1);
    int ended = 0;
    for (long n = 0; n < 100; n += 7) {
      BodyOptions plain;
      plain.threads = threads;
      BodySolver used(plain);
      fail_allocation(n);
      try {
        used.solve(small.bodies, small.contacts);
      } catch (const std::bad_alloc&) {
        ++ended;
      }
      fail_allocation(-1);
      INFO("allocation " << n);
      CHECK(used.solve(small.bodies, small.contacts).status == Status::solved);
    }
    CHECK(ended > 3);
  }
}

TEST_CASE("faults: memory that ends in the making of a stepper or in a step") {
  for (const double restitution : {0.0, 0.5}) {
    stepping::Scene scene(5e-3);
    scene.friction(0.4, restitution);
    scene.ground();
    for (int k = 0; k < 6; ++k)
      scene.sphere(0.1, 1.0 + k, {0.05 * (k % 2), 0.03 * (k % 3), 0.1 + 0.19 * k});
    CHECK(fail_each_allocation([&] {
            tc::Stepper stepper = scene.stepper();
            stepping::run(stepper, 0.05);
          }) > 20);
  }
}
