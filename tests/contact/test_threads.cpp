// Tether: threads that wait for each other between colours. SPDX-License-Identifier: BSD-3-Clause
#include <atomic>
#include <chrono>
#include <thread>

#include "body_passes/worker_team.hpp"
#include "support/catch.hpp"

using namespace tether::contact::detail;

// Sleepers are woken late and make the others sleep: below a wake-up's time spinning is cheaper.
TEST_CASE("threads: waits are long, short after a wait in vain, and long again") {
  SpinCounts p;
  const int patient = p.spins();
  p.slept();
  const int impatient = p.spins();
  CHECK(10 * impatient < patient);
  int short_waits = 0;
  while (p.spins() == impatient && short_waits < 100) p.met(), ++short_waits;
  CHECK(short_waits >= 1);
  CHECK(short_waits <= 10);
  // Always in vain, as where others have the core: long waits become rare.
  int long_waits = 0;
  for (int k = 0; k < 10000; ++k) {
    long_waits += p.spins() == patient;
    p.slept();
  }
  CHECK(long_waits >= 1);
  CHECK(long_waits < 25);
  // And common again where all meet.
  for (int k = 0; k < 10000; ++k) p.met();
  CHECK(p.spins() == patient);
  p.slept();
  short_waits = 0;
  while (p.spins() == impatient && short_waits < 100) p.met(), ++short_waits;
  CHECK(short_waits <= 16);
}

TEST_CASE("threads: nobody passes a meeting before all have come, awake or asleep") {
  WorkerTeam team;
  for (int threads : {2, 3}) {
    std::atomic<int> come{0};
    std::atomic<int> early{0};
    auto work = [&](int thread) {
      SpinCounts spins;
      for (int round = 1; round <= 300; ++round) {
        // Later than anyone spins, now and then.
        if (round % 100 == 0 && thread == round / 100 % threads)
          std::this_thread::sleep_for(std::chrono::milliseconds(2));
        ++come;
        team.barrier.wait(spins);
        early += come.load() < threads * round;
        team.barrier.wait(spins);
      }
    };
    team.run(threads, work);
    CHECK(come.load() == 300 * threads);
    CHECK(early.load() == 0);
  }
}
