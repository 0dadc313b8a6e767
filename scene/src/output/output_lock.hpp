// Tether: one run at a time writes a file. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace tether::scene {

/// Holds FILE.lock for each file that a run writes. The system lets go of it when the process ends,
/// however it ends: a lock file that is left behind locks nothing.
class OutputLock {
 public:
  OutputLock() = default;
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

  /// Throws std::runtime_error if another run writes the file now. Makes its folder. Files that are
  /// no regular files (/dev/null) have no lock, nor have folders without locks (some networks).
  void take(const std::string& file);

 private:
  struct Held {
    std::string name;
    int descriptor;
  };
  std::vector<Held> held_;
};

}  // namespace tether::scene
