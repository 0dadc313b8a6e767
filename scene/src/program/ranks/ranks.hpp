// Tether: the processes of one run. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/ranks.hpp>

namespace tether::scene {

/// Processes ("ranks") that mpirun has started for one run. The module tether_mpi.so has it, so
/// that the program needs no MPI. Every process makes the same calls.
class Ranks {
 public:
  virtual ~Ranks() = default;
  virtual contact::RankMessages& messages() = 0;
  /// Largest of the numbers that the processes give.
  virtual int largest(int number) = 0;
  /// The exit code of all: the largest. why: what has ended this one, empty: nothing has; the first
  /// process that has something to say says it. Where others are still at work a second later,
  /// which wait for this one, ends them all.
  virtual int finish(int status, const std::string& why) = 0;
};

/// Type of the module's `tether_make_ranks`. version: of the program; null: the module's differs.
using MakeRanks = Ranks*(const char* version);

/// Null unless several processes have been started. Throws std::runtime_error without the module.
std::unique_ptr<Ranks> join_ranks();

}  // namespace tether::scene
