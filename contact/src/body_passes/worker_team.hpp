// Tether: threads that wait for work, and meet inside it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "kernels/body_contacts.hpp"

namespace tether::contact::detail {

// How long a thread spins before it sleeps. A thread that sleeps is woken tens of microseconds
// later, late for the next meeting, where the other one sleeps then: where all have a core,
// spinning for longer than that is the cheaper way to wait. Where others have taken the core it
// waits for nothing: a wait in vain is followed by short ones, twice as many each time.
class SpinCounts {
 public:
  int spins() const { return short_waits_ > 0 ? kShort : kLong; }
  void met() {
    if (short_waits_ > 0)
      --short_waits_;
    else if (in_vain_ > kFirst)
      in_vain_ /= 2;
  }
  void slept() {
    if (short_waits_ > 0) {
      --short_waits_;
      return;
    }
    short_waits_ = in_vain_;
    if (in_vain_ < kMost) in_vain_ *= 2;
  }

 private:
  static constexpr int kShort = 400, kLong = 5000;  // of 20 to 50 ns
  static constexpr int kFirst = 8, kMost = 1024;    // meetings
  int short_waits_ = 0, in_vain_ = kFirst;
};

// All threads meet; the last one to come lets the others go. A thread that only yields may share a
// core with the one that it waits for, while a sleeping one is woken on a core that is free.
class Barrier {
 public:
  void reset(int threads) { threads_ = threads; }
  void wait(SpinCounts& spins) {
    if (threads_ == 1) return;
    const int round = round_.load();
    if (come_.fetch_add(1) + 1 == threads_) {
      come_.store(0);
      round_.store(round + 1);
      if (sleepers_.load() > 0) wake();
      return;
    }
    for (int left = spins.spins(); left > 0; --left) {
      if (round_.load(std::memory_order_acquire) != round) {
        spins.met();
        return;
      }
#if defined(__x86_64__) || defined(__i386__)
      __builtin_ia32_pause();
#endif
    }
    spins.slept();
    sleep(round);
  }

 private:
  void wake();
  void sleep(int round);

  int threads_ = 1;
  alignas(64) std::atomic<int> come_{0};
  alignas(64) std::atomic<int> round_{0};
  std::atomic<int> sleepers_{0};
  std::mutex mutex_;
  std::condition_variable woken_;
};

// Threads are started when they are first needed and sleep between runs.
class WorkerTeam {
 public:
  ~WorkerTeam();

  // Calls work(thread) for thread = 0 (the caller) .. threads - 1; returns when all have ended.
  // `work` must not throw.
  template <class Work>
  void run(int threads, Work& work) {
    barrier.reset(threads);
    if (threads > 1) {
      start(
          threads, [](void* w, int thread) { (*static_cast<Work*>(w))(thread); }, &work);
    }
    work(0);
    if (threads > 1) join();
  }

  Barrier barrier;

 private:
  using Call = void (*)(void*, int);
  void start(int threads, Call call, void* work);
  void join();
  void live(int thread);

  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable wake_, done_;
  Call call_ = nullptr;
  void* work_ = nullptr;
  long run_ = 0;
  int wanted_ = 0, busy_ = 0;
  bool end_ = false;
};

// Work space of one thread in a pass over contacts.
struct PassScratch {
  alignas(64) BodyState nowhere = {};  // see BodyArrays
  // The first contact that was refused, and why: other threads wait at the next barrier, so that it
  // is reported after the run.
  int refused = std::numeric_limits<int>::max();
  std::string reason;
};

class SweepPartners;

// All threads, or one; each has a Team of its own that says which of them it is.
struct Team {
  int thread, threads;
  Barrier* barrier;
  PassScratch* scratch;
  int passes = 0;                     // so far: the same number for each thread of a team
  SweepPartners* partners = nullptr;  // other processes that sweep the same island
  mutable SpinCounts spins = {};      // of this thread

  void meet() const {
    if (threads > 1) barrier->wait(spins);
  }
  // Work that the first thread does for all.
  template <class Work>
  void once(const Work& work) const {
    if (thread == 0) work();
    meet();
  }
  // This thread's part of begin .. end.
  int from(int begin, int end) const { return part(begin, end, thread); }
  int to(int begin, int end) const { return part(begin, end, thread + 1); }
  int part(int begin, int end, int k) const {
    return begin + static_cast<int>(static_cast<long long>(end - begin) * k / threads);
  }
};

}  // namespace tether::contact::detail
