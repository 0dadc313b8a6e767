// Tether: the threads that work on one island. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <string>

#include "body_passes/worker_team.hpp"
#include "kernels/body_contacts.hpp"

namespace tether::contact::detail {

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
