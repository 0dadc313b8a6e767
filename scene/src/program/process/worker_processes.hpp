// Tether: independent jobs in processes of their own. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace tether::scene {

/// Some processes do jobs 0 to n - 1, each the next one that nobody has begun. A job whose process
/// dies is lost, the others go on.
class WorkerProcesses {
 public:
  explicit WorkerProcesses(unsigned processes) : processes_(processes) {}

  std::function<std::string(std::size_t)> work;         ///< in a process of its own
  std::function<std::string(const std::string&)> lost;  ///< result of a job whose process died
  std::function<bool()> stopped;                        ///< true: no more jobs are begun
  std::function<void(std::size_t)> progress;            ///< jobs that are done

  /// Results in the order of the jobs; empty: not begun. Throws std::runtime_error where there are
  /// no processes to be had.
  std::vector<std::string> run(std::size_t jobs);

 private:
  unsigned processes_;
};

}  // namespace tether::scene
